"""The page in Chromium: the real server, the real control socket, and documents of an emulated station."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.northbound.browser import PROGRAM, Browser, Tab
from tests.northbound.shown_station import STATES, Shown, shown

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="no chromium here: apt-get install chromium")

TILES = "document.querySelectorAll('.tile').length"
FIRST = f"{TILES} > 0"
#: Time goes so much faster for what the page waits for.
FASTER = "globalThis.setTimeout = (what, ms) => slow(what, ms / 25);"
HANGUL = re.compile("[가-힣]")


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        yield browser


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    with shown(tmp_path_factory.mktemp("northbound")) as station:
        yield station


@pytest.fixture
def station(served: Shown) -> Shown:
    served.document = served.before
    served.asked.clear()
    return served


@pytest.fixture
def tab(chromium: Browser, station: Shown) -> Iterator[Tab]:
    tab = chromium.tab()
    yield tab
    tab.value("localStorage.clear()")
    tab.close()


def test_the_first_state_takes_four_requests_and_shows_every_bay(tab: Tab, station: Shown) -> None:
    tab.open(station.address, FIRST)
    paths = [url.removeprefix(station.address.rstrip("/")) for url in tab.requests()]
    needed = [path for path in paths if path != "/static/icon.svg"]  # which nothing waits for
    assert needed == ["/", "/static/page.css", "/static/page.js", "/api/stream?language=en"]
    assert tab.value("[...document.querySelectorAll('.tile')].map((one) => one.dataset.state)") == list(STATES)
    assert [tab.text(f".tile:nth-child({n}) .state").replace("\u00ad", "") for n in (1, 4)] == [
        "Charging", "Uncontrollable",
    ]  # fmt: skip
    danger = next(one for one in station.before["bays"] if one["alarm"] == "danger")
    assert danger["reason"] in tab.text(".alarms li:first-child")
    assert tab.complaints() == []


def test_stop_is_one_press_away_and_is_followed_to_the_charger(tab: Tab, station: Shown) -> None:
    tab.open(station.address, FIRST)
    width, height = tab.value(
        "(({width, height}) => [width, height])(document.querySelector('.stop').getBoundingClientRect())"
    )
    assert min(width, height) >= 48
    tab.click(".tile:first-child .stop")
    tab.wait("document.querySelector('.tile:first-child .asked').textContent.includes('● seen at the charger')")
    (asked,) = station.asked
    assert (asked["verb"], asked["bays"]) == ("stop", ["bay-1"])
    assert tab.value("location.pathname") == "/"


def test_a_reset_is_held_for_a_second_by_mouse_or_key(tab: Tab, station: Shown) -> None:
    tab.open(f"{station.address}bay/bay-2", "document.querySelector('button.hold')")
    assert "bay-2" in tab.text(".acts .hint")
    tab.mouse("button.hold", "mousePressed")
    tab.value("new Promise((done) => setTimeout(done, 300))")
    tab.mouse("button.hold", "mouseReleased")
    assert station.asked == []
    tab.value("document.querySelector('button.hold').focus()")
    tab.key("Enter", 13, "rawKeyDown")
    tab.wait("document.querySelector('.foot .asked').textContent.includes('● accepted')")
    tab.key("Enter", 13, "keyUp")
    assert [one["verb"] for one in station.asked] == ["reset"]  # nothing by the short press


def test_a_reset_is_refused_once_the_bay_has_changed_since_it_was_pressed(tab: Tab, station: Shown) -> None:
    tab.open(f"{station.address}bay/bay-2", "document.querySelector('button.hold')")
    bay = station.before["bays"][1]
    tab.value("document.querySelector('button.hold').click()")  # as a screen reader does
    station.document = {**station.before, "bays": [{**bay, "since": bay["since"] + 60.0, "reason": "It was new."}]}
    tab.wait("document.querySelector('.why').textContent.includes('It was new.')")
    tab.value("document.querySelector('button.hold').click()")
    tab.wait("document.querySelector('.foot .asked').textContent.includes('has changed since')")
    assert [(one["action"], one["since"]) for one in tab.posted()] == [("reset", bay["since"])]
    assert "accepted" not in tab.text(".foot .asked").lower()


def _with(station: Shown, number: int, part: str, **fields: object) -> dict[str, Any]:
    """The document with these fields in one part of a bay."""
    bays = list(station.before["bays"])
    bays[number] = {**bays[number], part: {**bays[number][part], **fields}}
    return {**station.before, "bays": bays}


def test_an_old_state_of_charge_is_not_shown_as_if_it_were_new(tab: Tab, station: Shown) -> None:
    station.document = _with(station, 0, "battery", old=["soc_pct"])
    tab.open(station.address, "document.querySelector('.tile .soc').textContent.endsWith('% (old)')")
    assert tab.value("getComputedStyle(document.querySelector('.tile .bar span')).backgroundColor") == tab.value(
        "getComputedStyle(document.querySelector('.tile .soc')).color"
    )
    tab.open(f"{station.address}bay/bay-1", "document.querySelector('.soc.old').textContent.endsWith('% (old)')")
    station.document = _with(station, 0, "battery", online=False, old=[])
    tab.wait("[...document.querySelectorAll('.card dd')].some((one) => /V \\(old\\)/.test(one.textContent))")
    assert tab.text(".soc.old").endswith("% (old)")


def test_the_sum_is_of_readings_that_are_not_old(tab: Tab, station: Shown) -> None:
    charger = {"current_a": 10.0, "voltage_v": 50.0, "old": False}
    bays = [
        {**one, "charger": {**one["charger"], **charger, "old": number > 1}}
        for number, one in enumerate(station.before["bays"])
    ]
    station.document = {**station.before, "bays": bays}
    tab.open(station.address, r"document.querySelector('.summary').textContent === '5 bays · 20\u202fA · 1.0\u202fkW'")
    station.document = {**station.before, "bays": [{**bays[2], "name": "bay-1"}]}
    tab.wait("document.querySelector('.summary').textContent === '1 bay'")


def test_a_figure_that_cannot_be_is_a_dash(tab: Tab, station: Shown) -> None:
    absurd = dict.fromkeys(("soc_pct", "voltage_v", "current_a", "temperature_c", "time_to_full_min"), 1e308)
    station.document = _with(station, 0, "battery", **absurd)
    tab.open(station.address, "document.querySelector('.tile .soc').textContent === '–'")
    assert re.fullmatch(r"– · [\d.]+\u202fA · –", tab.text(".tile .values"))
    tab.open(f"{station.address}bay/bay-1", "document.querySelector('.charge .soc').textContent === '–'")
    assert "– · – · –" in tab.text("dd")


def test_a_bay_that_is_not_there_says_so_whatever_its_name(tab: Tab, station: Shown) -> None:
    for name in ("nosuch", "%", "%ff", "%E0%A4"):
        said = f"document.querySelector('h1')?.textContent === 'This station has no bay {name}'"
        tab.open(f"{station.address}bay/{name}", said)
        assert tab.value("document.querySelector('.way a').pathname") == "/"


def test_every_limit_is_a_line_with_its_place(tab: Tab, station: Shown) -> None:
    texts = json.dumps([one["text"] for one in station.before["bays"][1]["limits"]])
    shown_texts = "[...document.querySelectorAll('.limits .text')].map((one) => one.textContent)"
    tab.open(f"{station.address}bay/bay-2", f"JSON.stringify({shown_texts}) === JSON.stringify({texts})")
    assert tab.value("document.querySelectorAll('.limits .blocking').length") >= 1


def test_korean_is_chosen_in_the_browser_and_kept(tab: Tab, station: Shown) -> None:
    tab.open(station.address, FIRST)
    tab.click(".tools button")
    tab.wait(
        "document.documentElement.lang === 'ko' && /[가-힣]/.test(document.querySelector('.tile .why').textContent)"
    )
    assert HANGUL.search(tab.text("nav")) and HANGUL.search(tab.text(".tile .state"))
    tab.open(f"{station.address}station", "document.querySelector('.policy')")
    assert tab.text("h1") == "스테이션"


def test_three_tabs_have_one_stream(chromium: Browser, station: Shown) -> None:
    tabs = [chromium.tab().open(station.address, FIRST) for _ in range(3)]
    assert sum("/api/stream" in url for tab in tabs for url in tab.requests()) == 1
    tabs.pop(0).close()
    station.document = station.after
    for tab in tabs:  # another one leads now
        tab.wait("document.querySelector('.tile').dataset.state === 'HELD'")
        assert not tab.value("document.body.classList.contains('stale')")
        tab.close()


@pytest.mark.parametrize("dark", [False, True])
def test_128_bays_fit_a_phone_and_a_wall(chromium: Browser, station: Shown, *, dark: bool) -> None:
    station.document = station.many(128)
    width = 1920 if dark else 360
    tab = chromium.tab(width=width, height=1080 if dark else 740, dark=dark)
    tab.open(station.address, f"{TILES} === 128")
    assert tab.value("document.documentElement.scrollWidth") <= width
    assert tab.value(
        "[...document.querySelectorAll('.stop')].every((one) => one.offsetWidth >= 48 && one.offsetHeight >= 48)"
    )
    tab.value("document.querySelector('input[type=search]').focus()")
    tab.ask("Input.insertText", text="bay-77")
    assert tab.value("[...document.querySelectorAll('.tile')].filter((one) => !one.hidden).length") == 1
    tab.close()


def test_how_long_nothing_was_heard_does_not_depend_on_a_clock_that_people_set(tab: Tab, station: Shown) -> None:
    tab.open(station.address, FIRST)
    with station.frozen():
        tab.value("{ const was = Date.now; Date.now = () => was() - 3600000 }")
        tab.value("{ const was = performance.now.bind(performance); performance.now = () => was() + 40000 }")
        lost = "document.querySelector('.lost').textContent"
        tab.wait(f"/^Not connected for 4\\d s/.test({lost})")
    tab.wait(f"{lost} === ''")


def test_what_nobody_answers_says_so_and_stays(tab: Tab, station: Shown) -> None:
    tab.open(f"{station.address}bay/bay-2", "document.querySelector('button.hold')")
    tab.value(f"{{ const slow = setTimeout; {FASTER} }}")
    asked = "document.querySelector('.foot .asked').textContent"
    with station.frozen():
        tab.click("button.stop")
        tab.wait(f"{asked} === 'Stop: Not delivered (no answer within 8 s). Use the charger\\'s own switch.'")
        tab.mouse("button.hold", "mousePressed")
        tab.wait(f"{asked} === 'Reset: Not delivered, not done (no answer within 5 s). Press again.'")
        tab.mouse("button.hold", "mouseReleased")
        tab.value("new Promise((done) => setTimeout(done, 5000))")
        assert "Press again" in str(tab.value(asked))


def test_what_is_old_says_so_at_once(tab: Tab, station: Shown) -> None:
    tab.open(station.address, FIRST)
    station.kill()
    tab.wait(r"/^Not connected for \d+ s: values are old$/.test(document.querySelector('.lost').textContent)")
    assert tab.value("document.body.classList.contains('stale')")
    assert tab.value("getComputedStyle(document.querySelector('main')).filter") == "grayscale(1)"
    tab.click(".tile:first-child .stop")
    tab.wait("document.querySelector('.tile:first-child .asked').textContent.includes('Not delivered')")
