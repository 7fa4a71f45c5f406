"""Which requests come in: by their names, their origin, their type."""

import pytest

from orchestrator.northbound.door import Door
from orchestrator.northbound.refusal import RefusalError

DOOR = Door.of("192.168.1.20", ["station-1.example"])
JSON = (b"content-type", b"application/json; charset=utf-8")


def status(method: str, *headers: tuple[bytes, bytes], path: str = "/api/request", address: str = "10.0.0.7") -> int:
    try:
        DOOR.check(method, path, headers, address)
    except RefusalError as error:
        return error.status
    return 200


@pytest.mark.parametrize(
    ("host", "wanted"),
    [
        (b"192.168.1.20:8080", 200), (b"station-1.example", 200), (b"Station-1.Example.:443", 200),
        (b"localhost:8080", 200), (b"[::1]:8080", 200), (b"10.0.0.7", 200),
        (b"evil.example", 421), (b"evil.example:8080", 421), (b"station-1.example.evil.example", 421),
        (b"", 421), (b"192.168.1.20@evil.example", 421), (b"localhost evil.example", 421), (b"[::2]", 421),
    ],
)  # fmt: skip
def test_only_our_own_names_are_answered(host: bytes, wanted: int) -> None:
    assert status("GET", (b"host", host)) == wanted


def test_a_request_without_a_name_is_refused() -> None:
    assert status("GET") == 421


@pytest.mark.parametrize(
    ("origin", "wanted"),
    [
        (b"https://station-1.example", 200), (b"http://station-1.example", 200),
        (b"https://station-1.example:8443", 403), (b"https://evil.example", 403), (b"null", 403), (b"", 403),
        (b"file://station-1.example", 403), (b"https://station-1.example.evil.example", 403),
        (b"https://[", 403),
    ],
)  # fmt: skip
def test_another_page_may_neither_ask_nor_read(origin: bytes, wanted: int) -> None:
    for method in ("POST", "GET"):
        assert status(method, (b"host", b"station-1.example"), (b"origin", origin), JSON) == wanted


def test_a_browser_that_says_that_the_request_is_of_another_site_is_believed() -> None:
    host = (b"host", b"localhost")
    assert status("POST", host, JSON, (b"sec-fetch-site", b"cross-site")) == 403
    assert status("POST", host, JSON, (b"sec-fetch-site", b"same-site")) == 403
    assert status("POST", host, JSON, (b"sec-fetch-site", b"same-origin")) == 200
    assert status("GET", host, (b"sec-fetch-site", b"cross-site"), path="/bay/bay-1") == 200, "a link on a label"


@pytest.mark.parametrize(
    "type_", [b"", b"text/plain", b"application/x-www-form-urlencoded", b"multipart/form-data", b"application/jsonx"]
)
def test_a_form_of_another_page_has_no_type_that_is_taken(type_: bytes) -> None:
    assert status("POST", (b"host", b"localhost"), (b"content-type", type_)) == 415


def test_other_methods_are_refused() -> None:
    for method in ("PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT"):
        assert status(method, (b"host", b"localhost"), JSON) == 405
