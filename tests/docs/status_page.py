"""docs/status.md from the records of the status document: `python -m tests.docs.status_page > docs/status.md`."""

import sys
from collections.abc import Iterator, Mapping
from typing import get_origin

from orchestrator.model.bay_document import Status
from orchestrator.model.document import VERSION
from orchestrator.model.document_schema import Member, about, members
from orchestrator.service.published import RATE
from orchestrator.service.streams import MOST_READERS, PATIENCE_S, TURN_S

HEAD = f"""\
# The status, for programs

`orchestrator status --json` prints this document, the sockets tell it, and `orchestrator schema status` is its JSON
Schema. This page is generated from the same records. It is version {VERSION}, in `version`: names and their meanings stay. New
names may come, so ignore what you do not know. If a name goes, or means something else, the version changes, and a
name that has gone is never used again.

Compare `id` and `key` of a reason; its `text` is for people, changes with language and version, and is made from the
`params` ([causes.md](causes.md) lists them all). A value that is not known is null, never 0. Times are Unix time in
seconds, unless they say otherwise.

## Asking

Connect to the control socket or the view socket ([install.md](install.md#who-may-use-it)), write one JSON object on one
line of at most 4096 bytes, and read one line:

    {{"verb": "status", "bay": null}}      # of all bays; with a name, of that one, with `limits` and `forecast`

The answer has `"ok": true` and the document's members. If it is `"ok": false`, `error` is a sentence and `cause` the
reason as data.

## Being told what changes

    {{"verb": "watch", "version": 1}}

The answer is a line for now, and then a line for every change until you close the connection:

```json
{{"ok": true, "revision": 41, "instance": "2f6c…", "document": {{"version": 1, "time": 1796000000.0, "bays": [], "…": "…"}}}}
{{"revision": 42, "time": 1796000003.1, "bays": {{"bay-3": {{"name": "bay-3", "state": "STOPPING", "…": "…"}}}}, "station": {{"alarm": "attention"}}}}
{{"revision": 42, "time": 1796000007.2}}
```

- `document` is the whole status. After that `bays` has the whole entry of each bay that has changed, `station` each of the
  other members that has changed, and `gone` the names of bays that are no more (a running service loses none today).
- `revision` increases while the service runs, `instance` is another one after a restart. There is a line at least every
  5 s, without a change if there is none; after longer silence, connect anew.
- A change of state, reason, fault, step, command or alarm is told within {TURN_S:.1f} s, figures once a
  second, of more than {RATE} bays in turn, {RATE} in a second; the watts of `supplies` once a second.
- What has only grown older is no change: as long as lines come, a value that is not mentioned is as it was, and as fresh
  as `old` says. Of a value that is too old its age is told as well.
- Who reads slowly is told the newest next and misses what was between. Who takes nothing for {PATIENCE_S:.0f} s is sent away.
  There may be {MOST_READERS} readers at a time; the next one is refused.

## On behalf of others

A program that passes on what people ask (a page, a broker) names them in `by`, a text of at most 200 characters with
door, user and address: `{{"verb": "stop", "bays": ["bay-3"], "by": "page, kim, 192.168.1.20"}}`. It stands beside the
program's own user in the reason, the record and the journal (`passed_on`), and never instead of it.
"""
#: What a type is called.
WORDS = {str: "text", float: "number", int: "integer", bool: "true or false"}


def page() -> str:
    """The page."""
    return "\n".join((HEAD, *_sections()))


def _sections() -> Iterator[str]:
    todo: list[type] = [Status]
    for record in todo:
        yield f"## {heading(record)}\n\n{about(record)}\n\n| name | type | meaning |\n| --- | --- | --- |"
        for member in members(record):
            yield f"| `{member.name}` | {_type(member)} | {_meaning(member)} |"
            if member.record is not None and member.record not in todo:
                todo.append(member.record)
        yield ""


def heading(record: type) -> str:
    """Its name in words."""
    name = record.__name__.removesuffix("Fields")
    return "".join(f" {one.lower()}" if one.isupper() else one for one in name).strip().capitalize()


def _type(member: Member) -> str:
    if member.record is not None:
        name = heading(member.record)
        kind = f"[{name.lower()}](#{name.lower().replace(' ', '-')})"
    else:
        kind = "object" if get_origin(member.kind) is Mapping else WORDS[member.kind]
    kind = f"list of {kind}" if member.is_list else kind
    return f"{kind}{', or null' * member.may_be_null}{', may be missing' * member.may_be_missing}"


def _meaning(member: Member) -> str:
    words = ", ".join(f"`{word}`" for word in member.words)
    return f"{member.about}{': ' * bool(words and member.about)}{words}"


if __name__ == "__main__":
    sys.stdout.write(page())
