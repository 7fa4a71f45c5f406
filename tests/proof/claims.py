"""What a status must and must not say, checked against the plant, which the service sees only through its devices."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from orchestrator.show import CUT_THE_MAINS
from orchestrator.sim.charger_frames import Kind
from orchestrator.workbench.replay.again import again
from orchestrator.workbench.replay.recording import read

if TYPE_CHECKING:
    from tests.proof.judge import Charger, Judge

#: Another program's use of a port is reported within this.
TOLD_S = 3.0
#: A charger that may run and is not heard raises an alarm this long after the start.
UNHEARD_S = 6.0
#: Below the first a pack in standby is not full; above the second it is not deeply discharged.
FULL_SOC, DEEP_SOC = 0.86, 0.3
#: No status may say this of a charger that has been in standby, and reported it, for that long.
DISOBEYS, STOOD_S = frozenset({"uncontrollable", "will_not_stop"}), 1.5
LINE_FAULTS = frozenset({"line_taken_over", "line_changed"})
#: Minimum time between charge starts of a station.
APART_S = 1.0
#: A plug with a bad contact causes at most this many charge starts per script.
LOOSE_STARTS = 4

Finding = tuple[str, str]  #: the invariant, what was seen


@dataclass(slots=True)
class Told:
    """The data on one charger remembered between statuses."""

    line_s: float = 0.0  #: when a change of its line was last reported
    locked_s: float | None = None  #: since when a foreign program uses its port
    ran_s: float = 0.0  #: when RUN was last written to its port
    starts: list[float] = field(default_factory=list)  #: when a frame switched it on


def claims(judge: "Judge", charger: "Charger", bay: Mapping[str, Any]) -> Iterator[Finding]:
    """The errors in a bay's status."""
    now_s, told, shown = judge.time.now_s, charger.told, f"{bay['state']}: {bay['reason']}"
    ids = set(_ids(bay["cause"]))
    if bay["state"] == "UNCONTROLLABLE" and bay["cause"]["id"] not in CUT_THE_MAINS:
        yield "what to do", f"out of control is not told with what to do first: {bay['reason']!r}"
    if bay["state"] == "FULL" and charger.rig.bay.pack.soc < FULL_SOC and _honest(charger):
        yield "full", f"the pack has {charger.rig.bay.pack.soc:.0%}, and the status says {shown}"
    if "under_voltage" in ids and charger.rig.bay.pack.soc > DEEP_SOC and _honest(charger):
        yield "what it is", f"the pack has {charger.rig.bay.pack.soc:.0%}, and the status says {shown}"
    if judge.booted_s is None:
        return
    if LINE_FAULTS & {fault["id"] for fault in bay["faults"]}:
        told.line_s = now_s
    tty, up_s = charger.rig.tty, judge.booted_s + TOLD_S
    ours_alone = not any(one.what == "estop" for one in judge.script.hazards)  # which also configures a port
    reached = (
        ours_alone and tty.present and charger.deaf_s < tty.changed_s - TOLD_S and tty.lock is not charger.rig.wire
    )
    if reached and up_s < tty.changed_s < now_s - TOLD_S and told.line_s < tty.changed_s:
        yield "not told", f"another program has set its port up otherwise, and the status says {shown}"
    locked = tty.lock is charger.rig.wire and tty.present
    told.locked_s = (told.locked_s or now_s) if locked else None
    if (
        told.locked_s is not None
        and now_s - max(told.locked_s, judge.booted_s) > 2 * TOLD_S
        and bay["alarm"] != "danger"
    ):
        yield "not told", f"another program has its port, nobody is alarmed, and the status says {shown}"
    if _runs_on(judge, charger) and now_s - judge.booted_s > UNHEARD_S and bay["alarm"] != "danger":
        yield "nobody is told", f"it runs since the last life, nobody is alarmed, and the status says {shown}"
    if DISOBEYS & ids and _stands(charger, now_s) and _says(charger):
        yield "false words", f"it stands since {now_s - charger.stood_s:.1f} s and says so, and the status says {shown}"
    if any(fault["id"] == "internal" for fault in bay["faults"]):
        yield "exception", shown


def _ids(cause: Any) -> Iterator[str]:
    """The ids of a cause in the status and of its nested causes."""
    if isinstance(cause, list):
        yield from (id_ for one in cause for id_ in _ids(one))
    elif isinstance(cause, dict):
        yield cause["id"]
        yield from (id_ for one in cause["params"].values() for id_ in _ids(one))


def starts(judge: "Judge", charger: "Charger") -> Iterator[Finding]:
    """A frame has switched a charger on."""
    now_s = judge.time.now_s
    for other in judge.chargers:
        if other is not charger and other.told.starts and now_s - other.told.starts[-1] < APART_S:
            yield "one after the other", f"it begins {now_s - other.told.starts[-1]:.2f} s after another bay"
    charger.told.starts.append(now_s)
    loose = any(one.what == "loose" and one.bay in (-1, charger.number) for one in judge.script.hazards)
    if loose and len(charger.told.starts) > LOOSE_STARTS:
        yield "loose plug", f"with a loose plug it has begun {len(charger.told.starts)} charges"


def record(judge: "Judge") -> Iterator[Finding]:
    """The replayed decisions of all lives match the recording."""
    with TemporaryDirectory(prefix="record") as directory:
        for path, inode in judge.gateway.disk.names.items():
            if path.endswith((".jsonl", ".gz")):
                Path(directory, Path(path).name).write_bytes(bytes(inode.data))
        try:
            taken = [(bay, one) for bay, steps in read([Path(directory)]).bays.items() for one in again(steps)]
        except Exception as error:  # noqa: BLE001 - whatever a power cut leaves must be readable
            yield "record", f"it cannot be read: {error!r}"
            return
    for bay, one in taken:
        if one.wrong:
            yield "record", f"{bay}, {one.recorded.at_s:.3f}: {one.wrong}"


def _runs_on(judge: "Judge", charger: "Charger") -> bool:
    """We switched it on in a former life, and it has received no stop since. A bad disk may have lost that."""
    ours = charger.stopped_s < charger.told.ran_s < (judge.booted_s or 0.0)
    bad_disk = any(one.what == "slow" and ":disk" in one.detail for one in judge.script.hazards)
    return charger.flows and ours and not bad_disk


def _stands(charger: "Charger", now_s: float) -> bool:
    """It has not run at all since then."""
    still_s = charger.rig.bay.charger.still_s
    return bool(charger.stood_s) and now_s - charger.stood_s > STOOD_S and still_s > STOOD_S and not charger.flows


def _says(charger: "Charger") -> bool:
    """The charger is heard and reports its true current."""
    wire = charger.rig.wire
    return not ({Kind.OPERATION, Kind.CURRENT} & {*wire.lies, *wire.liars} or wire.mute_tx or wire.mute_rx)


def _honest(charger: "Charger") -> bool:
    wire, bay = charger.rig.wire, charger.rig.bay
    return not (wire.lies or wire.liars or bay.falsify)
