"""The file of those who may log in, as it is read while others write it, and the words in it as they are written."""

from collections.abc import Mapping
from pathlib import Path

import yaml

from orchestrator.config.load import load_users
from orchestrator.config.northbound import User
from orchestrator.config.plainfile import read_plain
from orchestrator.config.yaml.tree import MAX_BYTES, Entries, Node, Scalar, parse

#: What a key without a value may have instead of one.
NOTHING = ("", "~", "null")


def users_in(path: Path) -> Mapping[str, User]:
    """The users in a file; nobody if its key `users` has nothing. Raises `ConfigError`, and `OSError`."""
    node, wrong = parse(str(path), read_plain(path, MAX_BYTES, "a file of users"))
    return {} if not wrong and _names_nobody(node) else load_users(path).users


def quoted(text: str) -> str:
    """In quotes, so that YAML takes it for nothing else: `0`, `null` and `yes` are names, too."""
    return str(yaml.safe_dump(text, default_style='"', allow_unicode=True, width=10_000)).strip()


def _names_nobody(node: Node | None) -> bool:
    if not isinstance(node, Entries) or [name.text for name, _ in node.entries] != ["users"]:
        return False
    value = node.entries[0][1]
    return value.plain and value.text in NOTHING if isinstance(value, Scalar) else value == Entries(value.mark, ())
