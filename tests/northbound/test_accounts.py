"""Passwords, sessions, failed logins, and the file of users."""

from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.config.load import load_users
from orchestrator.config.northbound import Role, User
from orchestrator.model import Cause
from orchestrator.northbound import password, user_verb
from orchestrator.northbound.backoff import Backoff
from orchestrator.northbound.sessions import LASTS_S, MOST, MOST_OF_ONE, Me, Sessions
from orchestrator.northbound.users import Users


@pytest.fixture(autouse=True)
def cheap(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hash costs nothing here."""
    monkeypatch.setattr(password, "N", 2**4)


def write(path: Path, **users: str) -> None:
    lines = [f"  {name}: {{role: {role}, password: '{password.hashed(name * 3)}'}}" for name, role in users.items()]
    path.touch(0o600)
    path.write_text("\n".join(["users:", *lines, ""]), encoding="utf-8")


def test_a_password_matches_its_hash_alone() -> None:
    told = password.hashed("correct horse", b"\1" * 16)
    assert told.startswith(f"scrypt:16:8:1:{'01' * 16}:")
    assert password.matches("correct horse", told)
    assert not password.matches("correct hors", told)
    assert not password.matches("", told)
    assert not password.matches("x" * 10**6, told), "too long to be hashed"
    assert not password.matches("correct horse", told.replace("scrypt:16", "scrypt:15")), "no power of two"
    assert not password.matches("correct horse", told.replace("scrypt:16", "scrypt:1048576")), "too much memory"
    assert not password.matches("correct horse", "plain")


def test_failures_cost_time_and_are_forgotten() -> None:
    backoff = Backoff(free=2, longest_s=10.0)
    for _ in range(2):
        backoff.failed("kim", 0.0)
    assert backoff.wait_s("kim", 0.0) == 0
    waits = []
    for _ in range(5):
        backoff.failed("kim", 0.0)
        waits.append(backoff.wait_s("kim", 0.0))
    assert waits == [2, 4, 8, 10, 10]
    assert backoff.wait_s("kim", 9.0) == 1
    assert backoff.wait_s("lee", 0.0) == 0
    backoff.failed("kim", 10_000.0)
    assert backoff.wait_s("kim", 10_000.0) == 0
    backoff.succeeded("kim")


def test_no_more_failures_are_remembered_than_fit() -> None:
    backoff = Backoff(free=0, longest_s=10.0, most=3)
    for name in "abcd":
        backoff.failed(name, 0.0)
    assert [backoff.wait_s(name, 0.0) for name in "abcd"] == [0, 2, 2, 2]


@pytest.fixture(name="users")
def _users(tmp_path: Path) -> Users:
    write(tmp_path / "users.yaml", kim="operator", lee="viewer")
    return Users(tmp_path / "users.yaml", lambda _: None)


def user(users: Users, name: str) -> User:
    found = users.get(name)
    assert found is not None
    return found


def test_a_session_is_somebodys_until_it_ends(users: Users) -> None:
    sessions = Sessions(users)
    id_ = sessions.begin("lee", user(users, "lee"), 0.0)
    assert sessions.me(id_, LASTS_S - 1) == Me("lee", Role.VIEWER)
    assert sessions.me(id_, LASTS_S) is None
    assert sessions.me("", 0.0) is None
    assert sessions.me(id_ + "x", 0.0) is None
    sessions.end(id_)
    assert sessions.me(id_, 0.0) is None


def test_a_user_has_so_many_sessions_and_no_more(users: Users) -> None:
    sessions = Sessions(users)
    ids = [sessions.begin("kim", user(users, "kim"), 0.0) for _ in range(MOST_OF_ONE + 1)]
    assert [sessions.me(id_, 1.0) is not None for id_ in ids] == [False, *[True] * MOST_OF_ONE]
    assert len(set(ids)) == len(ids)


def test_all_users_together_have_so_many_sessions_and_no_more(users: Users) -> None:
    sessions = Sessions(users)
    for number in range(MOST + 10):
        sessions.begin(f"user-{number}", user(users, "kim"), 0.0)
    assert len(sessions._sessions) == MOST


def test_whoever_is_taken_out_or_gets_a_new_password_or_role_has_it_at_once(users: Users, tmp_path: Path) -> None:
    sessions = Sessions(users)
    kim, lee = (sessions.begin(name, user(users, name), 0.0) for name in ("kim", "lee"))
    kept = (tmp_path / "users.yaml").read_text(encoding="utf-8")
    (tmp_path / "users.yaml").write_text(kept.replace("operator", "viewer"), encoding="utf-8")
    users.look()
    assert sessions.me(kim, 1.0) == Me("kim", Role.VIEWER)
    write(tmp_path / "users.yaml", kim="operator")
    users.look()
    assert sessions.me(kim, 1.0) is None, "another hash"
    assert sessions.me(lee, 1.0) is None, "taken out"


def test_a_file_that_is_broken_or_open_to_others_is_doubted_until_it_is_well_and_is_told(tmp_path: Path) -> None:
    path, said = tmp_path / "users.yaml", list[Cause]()
    write(path, kim="operator")
    kept = path.read_text(encoding="utf-8")
    users = Users(path, said.append)
    for text in ("users: {", "", kept.replace("operator", "chef"), "users: {}\nmore: {}\n", "users: []\n"):
        path.write_text(text, encoding="utf-8")
        assert not users.look()
        assert not users.look()
        assert users.doubtful, text
    path.write_text(kept, encoding="utf-8")
    assert users.look()
    assert not users.doubtful
    path.chmod(0o640)
    users.look()
    assert users.doubtful
    assert "mode 0640" in said[-1].param("why")
    assert users.get("kim") is not None
    path.chmod(0o600)
    users.look()
    assert [cause.id for cause in said] == [*["users_doubted"] * 5, "users_trusted", "users_doubted", "users_trusted"]


@pytest.mark.parametrize("text", ["users:\n", "# nobody\nusers: {}\n", "users: ~\n", None])
def test_a_file_that_names_nobody_or_is_gone_ends_all_sessions(tmp_path: Path, text: str | None) -> None:
    path, said = tmp_path / "users.yaml", list[Cause]()
    write(path, kim="operator")
    users = Users(path, said.append)
    kept, sessions = path.read_text(encoding="utf-8"), Sessions(users)
    kim = sessions.begin("kim", user(users, "kim"), 0.0)
    path.unlink() if text is None else path.write_text(text, encoding="utf-8")
    assert users.look()
    assert (users.doubtful, sessions.me(kim, 1.0), [one.id for one in said]) == (False, None, ["users_none"])
    sessions.drop_strangers()
    path.touch(0o600)
    path.write_text(kept, encoding="utf-8")
    assert users.look()
    assert sessions.me(kim, 1.0) is None, "a new login is needed"
    assert user(users, "kim")


@pytest.mark.parametrize("name", ["0", "007", "null", "true", "yes", "1e5", "0x10", "1_000", "김", "_"])
def test_a_name_that_yaml_would_take_for_something_else_is_that_name(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "users.yaml"
    path.touch(0o600)
    path.write_text("users:\n", encoding="utf-8")
    for one in (name, "kim"):
        _type(monkeypatch, "long enough")
        assert add(one, "viewer", path) == 0
    assert list(load_users(path).users) == [name, "kim"]
    assert Users(path, lambda _: None).get(name) is not None


def test_what_would_not_read_back_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "users.yaml"
    write(path, kim="operator")
    before = path.read_text(encoding="utf-8")
    monkeypatch.setattr(user_verb, "quoted", str)
    _type(monkeypatch, "long enough")
    assert add("null", "viewer", path) == 1
    assert "nothing is changed" in capsys.readouterr().err
    assert path.read_text(encoding="utf-8") == before
    assert [file.name for file in tmp_path.iterdir()] == ["users.yaml"]


def add(name: str, role: str, path: Path) -> int:
    return main(["user", "add", name, "--role", role, "--file", str(path)])


def test_the_verb_writes_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "users.yaml"
    for name, role, word in (("kim", "operator", "first secret"), ("lee", "viewer", "second secret")):
        _type(monkeypatch, word)
        assert add(name, role, path) == 0
    found = load_users(path).users
    assert {name: one.role for name, one in found.items()} == {"kim": Role.OPERATOR, "lee": Role.VIEWER}
    assert password.matches("first secret", found["kim"].password)
    assert path.stat().st_mode & 0o777 == 0o600
    assert "secret" not in path.read_text(encoding="utf-8")
    _type(monkeypatch, "third secret")
    assert add("kim", "viewer", path) == 0
    assert load_users(path).users["kim"].role is Role.VIEWER
    assert [file.name for file in tmp_path.iterdir()] == ["users.yaml"]


def test_a_short_password_or_a_name_that_nobody_can_type_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _type(monkeypatch, "short")
    assert add("kim", "operator", tmp_path / "users.yaml") == 2
    assert add("kim lee", "operator", tmp_path / "users.yaml") == 2
    assert not (tmp_path / "users.yaml").exists()
    _type(monkeypatch, "long enough")
    assert add("kim", "operator", tmp_path / "nowhere" / "users.yaml") == 1
    assert "cannot be written" in capsys.readouterr().err
    assert add("kim", "operator", tmp_path) == 1, "a directory"
    assert "Traceback" not in capsys.readouterr().err


def _type(monkeypatch: pytest.MonkeyPatch, line: str) -> None:
    from io import StringIO

    monkeypatch.setattr("sys.stdin", StringIO(f"{line}\n"))
