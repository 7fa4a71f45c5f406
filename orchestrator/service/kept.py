"""What must outlive the process: where current flows, what an operator holds, and the faults that wait for a person.

A restart is neither a reset nor a start. And a charger is stopped first at every start, so that no status can show
afterwards whether it had been left running: this file does.
"""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from orchestrator.core.faults import ROW, Clear
from orchestrator.core.latches import BACKOFF_S, clear_after_s
from orchestrator.core.memory import FaultMemory, Memory
from orchestrator.model import ENERGISED, State

FILE = "kept.json"
#: In these a charger may be delivering current.
RUNNING = ENERGISED | {State.STOPPING, State.UNCONTROLLABLE}
NOBODY_KNOWS = "nobody knows which faults were latched; start to go on"
UNFINISHED = "the last run of this service ended in mid-charge and did not verify the stop"


@dataclass(frozen=True, slots=True)
class Kept:
    """Of one bay."""

    running: bool = False  #: the charger was told to run, and was not verified to stand by since
    hold: str = ""  #: as in the core's memory
    paused: bool = False
    faults: Mapping[str, str] = field(default_factory=dict)  #: id → evidence

    @classmethod
    def of(cls, memory: Memory) -> "Kept":
        """What to keep of a bay's memory."""
        waiting = {
            name: fault.text
            for name, fault in memory.faults.items()
            if fault.raised_s is not None and clear_after_s(ROW[name], fault) is None
        }
        return cls(memory.state in RUNNING, memory.hold, memory.paused, waiting)

    def memory(self, now_s: float) -> Memory:
        """What the bay begins with."""
        faults = {**self.faults, **({"found_running": UNFINISHED} if self.running else {})}
        unknown = [f"{text}; start to go on" for name, text in faults.items() if name not in ROW]
        known = {name: _fault(name, text, now_s) for name, text in faults.items() if name in ROW}
        return Memory(hold=self.hold or "; ".join(unknown), paused=self.paused, faults=known)


def _fault(name: str, text: str, now_s: float) -> FaultMemory:
    clear = ROW[name].clear
    strikes = (now_s,) * (len(BACKOFF_S) + 1) if clear is Clear.BACKOFF else ()  # it would not have been kept with less
    return FaultMemory(raised_s=now_s, text=text, latched=clear is not Clear.OPERATOR, strikes=strikes)


def read_kept(directory: Path, bays: Iterable[str]) -> dict[str, Kept]:
    """What the last run kept. Where that cannot be read, every bay is held: nobody knows what was latched."""
    path = directory / FILE
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        json.dumps(document, ensure_ascii=False).encode()  # half a character can be neither shown nor written again
        return {name: _kept(document.get(name, {})) for name in bays}
    except FileNotFoundError:
        ran = any(directory.glob("events*"))  # what is kept is written along with the first of them
        lost = f"{path} is lost, though this service has run here before: {NOBODY_KNOWS}" if ran else ""
        return {name: Kept(hold=lost) for name in bays}
    except (OSError, ValueError, TypeError, AttributeError, RecursionError) as error:
        lost = f"{path} cannot be read ({error}): {NOBODY_KNOWS}"
        return {name: Kept(hold=lost) for name in bays}


def _kept(values: dict[str, object]) -> Kept:
    """The record in a JSON object; TypeError, ValueError or AttributeError if it is none."""
    kept = Kept(**values)  # type: ignore[arg-type]  # the types are checked right below
    texts = (kept.hold, *kept.faults.keys(), *kept.faults.values())
    if not all(isinstance(text, str) for text in texts) or {type(kept.running), type(kept.paused)} != {bool}:
        raise ValueError(f"{values} is not what was written")
    return kept


def write_kept(directory: Path, kept: Mapping[str, Kept]) -> None:
    """Replace the file as a whole; OSError where the disk does not take it."""
    directory.mkdir(parents=True, exist_ok=True, mode=0o750)
    fresh = directory / f"{FILE}.new"
    with fresh.open("w", encoding="utf-8") as file:
        json.dump({name: asdict(one) for name, one in kept.items()}, file, ensure_ascii=False, indent=1)
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(directory / FILE)
