"""What those who are logged in can do while the file of users is of no use."""

from pathlib import Path

import pytest

from orchestrator.northbound import password
from tests.northbound.bench import page


def test_an_operator_can_stop_and_pause_and_nobody_can_log_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(password, "N", 2**4)
    file = tmp_path / "users.yaml"
    file.touch(0o600)
    told = f"users:\n  kim: {{role: operator, password: '{password.hashed('kim secret')}'}}\n"
    file.write_text(told, encoding="utf-8")
    with page(tmp_path, "users: users.yaml\n") as (browser, station):

        def act(action: str) -> int:
            return browser.post("/api/request", {"action": action, "bay": "bay-1"}).status

        assert browser.login("kim", "kim secret").status == 200
        file.write_text("users: {", encoding="utf-8")
        assert browser.get("/api/me").json["me"]["name"] == "kim"
        assert [act(action) for action in ("start", "stop", "pause", "reset")] == [503, 200, 200, 503]
        assert [one["verb"] for one in station.asked] == ["stop", "pause"]
        cookie = browser.cookie
        answer = browser.login("kim", "kim secret")
        assert (answer.status, answer.error) == (503, "users_unsure")
        file.write_text(told, encoding="utf-8")
        browser.cookie = cookie
        assert act("start") == 200
        file.unlink()
        assert act("stop") == 401
        assert browser.login("kim", "kim secret").status == 401
    lines = capfd.readouterr().err
    assert [lines.count(part) for part in ("is of no use: ", "in order again", "names nobody")] == [1, 1, 1]
