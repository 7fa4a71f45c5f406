"""docs/causes.md from the catalogue of texts: `python -m tests.docs.cause_page > docs/causes.md`."""

import sys
from collections.abc import Iterator
from string import Formatter

from orchestrator.text.catalogue import LANGUAGES

HEAD = """\
# Causes

Whatever the service says of a bay is a cause: data, of which the sentence is made. That includes what is wrong with its
port, its bus, its BMU or the disk, and what is answered to a request. `status --json`, the journal and the answers carry
both. A program compares `id` and `key`, never the text: figures change all the time, and the text with the language.

```json
{"id": "over_temperature", "params": {"pack_c": 45.2, "limit_c": 45, "again_c": 40.0, "effect": "PAUSE"},
 "key": "pack.temperature_c", "place": "policies/li-ion-48v.yaml:21", "advice": "over_temperature",
 "text": "the pack has 45.2 °C, the limit is 45 °C (policies/li-ion-48v.yaml:21); …"}
```

| field | what it is |
| --- | --- |
| `id` | which cause; an id is never used again for another one |
| `params` | figures, with their units in their names: `_v`, `_a`, `_c` (°C), `_pct`, `_s`, `_min`, `_h`, `_ah`, `_wh`; words of a fixed list; other causes |
| `key`, `place` | the key of policy or station file that sets the limit, and the line where it stands; empty where there is none |
| `advice` | what a person shall do: of a fault its id in [faults.md](faults.md) |

Some parameters are added by what the cause stands in: `effect` and `strikes` (a fault: what it does, how often it came
within an hour), `past` (it is gone, and told in the past tense), `since_at` and `was`, or `raised_at`, `worst` and `now`
(the times of a fault and its figures), `then` and `how` (what comes next, what to type), `where` (which bus).

Moments are the time of day in the station's own time, with the date where it is another day, in parameters called `_at`;
beside a fault `since`, `gone_since` and `clears_at` are the same as Unix time, and `clears` is what ends it. The journal
has them as the core does, in seconds of the monotonic clock (`_t_s`), of which `t` stands on each line.

`language: ko` in the station file makes the texts Korean. `orchestrator status` and the other verbs say them in the
language of `LC_ALL`, `LC_MESSAGES` or `LANG`, whatever the service writes; where none of them is set, in the service's.

The same in every language are names: of bays, faults, states, effects, verbs, keys, and the heads of the table. Only in
English are diagnostics: errors of files (FILE:LINE:COLUMN), of the command line and of a service that cannot be reached,
what `check` (but for its last line), `probe`, `decode`, `replay` and the like print, the text of an exception, and what
the last resort says (`estop`, the guardian), which must work when nothing else does. This page is made from the catalogue itself.

"""


def page() -> str:
    """The whole page."""
    return HEAD + "\n".join(_table()) + "\n"


def _table() -> Iterator[str]:
    yield "| id | parameters | English | Korean |"
    yield "| --- | --- | --- | --- |"
    english, korean = LANGUAGES["en"].texts, LANGUAGES["ko"].texts
    for id_ in sorted(english):
        params = ", ".join(f"`{name}`" for name in dict.fromkeys(_params(english[id_])))
        yield f"| `{id_}` | {params or '–'} | {_shown(english[id_])} | {_shown(korean[id_])} |"


def _params(template: str) -> Iterator[str]:
    return (name for _, name, _, _ in Formatter().parse(template) if name not in (None, "at"))


def _shown(template: str) -> str:
    """With the names of the parameters only; where the place stands, nothing."""
    parts = Formatter().parse(template.replace("\n", "<br>"))  # a line break would end the table
    return "".join(text + (f"{{{name}}}" if name not in (None, "at") else "") for text, name, _, _ in parts)


if __name__ == "__main__":
    sys.stdout.write(page())
