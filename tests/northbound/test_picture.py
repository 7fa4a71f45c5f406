"""What a reader is told: each thing once, as it is now."""

from typing import Any

from orchestrator.northbound.picture import MOST_GONE, Picture
from orchestrator.northbound.told import fields
from tests.northbound.bench import bay


def document(*bays: dict[str, Any], alarm: str = "none") -> dict[str, Any]:
    return {"ok": True, "station": "hall", "language": "en", "alarm": alarm, "bays": list(bays)}


def told(picture: Picture, seen: int | None, language: str = "") -> dict[str, Any]:
    return fields(picture.since(seen), language)


def test_the_first_thing_is_the_whole_document() -> None:
    picture = Picture(100)
    assert not picture.known
    assert picture.replace(document(bay("b"), bay("a")))
    whole = told(picture, None)
    assert whole["revision"] == 101
    assert [one["name"] for one in whole["document"]["bays"]] == ["b", "a"]
    assert "ok" not in whole["document"]


def test_what_is_the_same_is_no_change() -> None:
    picture = Picture(100)
    picture.replace(document(bay("a")))
    assert not picture.replace(document(bay("a")))
    assert picture.revision == 101


def test_a_slow_reader_gets_each_bay_once_as_it_is_now() -> None:
    picture = Picture(100)
    picture.replace(document(bay("a"), bay("b"), bay("c")))
    seen = picture.revision
    for state in ("QUALIFYING", "CHARGING"):
        picture.replace(document(bay("a", state), bay("b"), bay("c")))
    picture.replace(document(bay("a", "CHARGING"), bay("b", "FULL"), bay("c"), alarm="danger"))
    change = told(picture, seen)
    assert {name: one["state"] for name, one in change["bays"].items()} == {"a": "CHARGING", "b": "FULL"}
    assert change["station"] == {"alarm": "danger"}
    assert change["gone"] == []
    assert told(picture, change["revision"])["bays"] == {}


def test_a_bay_that_goes_is_told_and_one_that_comes_back_is_none_of_them() -> None:
    picture = Picture(100)
    picture.replace(document(bay("a"), bay("b")))
    seen = picture.revision
    picture.replace(document(bay("a")))
    assert told(picture, seen)["gone"] == ["b"]
    picture.merge({"b": bay("b")}, {}, [])
    change = told(picture, seen)
    assert (change["gone"], list(change["bays"])) == ([], ["b"])


def test_another_order_is_a_new_document() -> None:
    picture = Picture(100)
    picture.replace(document(bay("a"), bay("b")))
    seen = picture.revision
    picture.replace(document(bay("b"), bay("a")))
    assert "document" in told(picture, seen)


def test_whoever_has_seen_what_is_none_of_ours_gets_everything() -> None:
    picture = Picture(100)
    picture.replace(document(bay("a")))
    for seen in (0, 99, 100, 102, 10**9):
        assert "document" in told(picture, seen)


def test_what_has_gone_is_not_remembered_for_ever() -> None:
    picture = Picture(100)
    picture.replace(document(bay("a")))
    seen = picture.revision
    for number in range(MOST_GONE + 1):
        picture.merge({f"x{number}": bay(f"x{number}")}, {}, [])
        picture.merge({}, {}, [f"x{number}"])
    assert "document" in told(picture, seen)


def test_every_sentence_is_in_the_readers_language() -> None:
    picture = Picture(100)
    picture.replace(document(bay("a")))
    (found,) = told(picture, None, "ko")["document"]["bays"]
    assert found["reason"].startswith("팩 온도가 45.2 °C")
    assert found["cause"]["text"] == found["reason"]
    assert found["cause"]["params"] == {"pack_c": 45.23, "limit_c": 45, "again_c": 40.0}
