"""Scripts for transitions made neither by the grid's ways into its states nor by its faults."""

from orchestrator.model import State
from tests.proof.exploring import NEVER
from tests.proof.script import BaySetup, Happening, Script

#: Transitions in the table that no run makes, and why.
NEVER_MADE = {
    **NEVER,
    (State.STARTING, State.FULL): "only a restart leads there, and every script here is one life",
    (State.IDLE, State.FULL): "a full bay is idle only while the service ends",
}

HALF = BaySetup(line="perfect")
#: Has nothing to do.
IDLES = BaySetup(soc_pct=99.0, line="perfect")
#: Qualifies at 2.2 s, charges from 4.6 s, is full at 13.0 s, verified at 13.9 s.
NEARLY_FULL = BaySetup("demo", soc_pct=93.0)


def _script(setup: BaySetup, *happenings: tuple[float, str] | tuple[float, str, float]) -> Script:
    befalls = tuple(Happening(one[0], 0, one[1], one[2] if len(one) > 2 else None) for one in happenings)
    last_s = befalls[-1].t_s
    return Script(0, (setup,), befalls, last_s + 22.0, last_s + 14.0)


#: Transitions covered → script.
PATHS: dict[str, Script] = {
    "FULL → OFFLINE → FULL": _script(NEARLY_FULL, (15.0, "charger_cut_off"), (19.0, "heal")),
    "FULL → QUALIFYING → FULL": _script(NEARLY_FULL, (15.0, "implausible_soc", 50.0), (16.0, "heal")),
    "FULL → SUSPENDED → FULL": _script(NEARLY_FULL, (15.0, "pause"), (16.0, "start")),
    "FULL → HELD → FULL": _script(NEARLY_FULL, (15.0, "stop"), (16.0, "start")),
    "UNCONTROLLABLE → FULL": _script(NEARLY_FULL, (13.1, "charger_cut_off"), (18.0, "heal")),
    "UNCONTROLLABLE → OFFLINE": _script(
        HALF, (8.0, "bmu_silent"), (8.0, "charger_cut_off"), (14.0, "heal"), (14.0, "bmu_silent")
    ),
    "UNCONTROLLABLE → SUSPENDED": _script(HALF, (8.0, "charger_cut_off"), (14.0, "heal")),
    "UNCONTROLLABLE → HELD": _script(HALF, (8.0, "charger_cut_off"), (13.0, "stop"), (14.0, "heal")),
    "UNCONTROLLABLE → IDLE": _script(HALF, (8.0, "charger_cut_off"), (14.0, "heal"), (14.0, "battery_removed")),
    "STARTING → UNCONTROLLABLE": _script(BaySetup(running=True), (0.0, "ignore_stop")),
    "STARTING → SUSPENDED": _script(HALF, (0.0, "charger_cut_off"), (1.5, "pause"), (2.0, "heal")),
    "STARTING → IDLE": _script(IDLES, (0.0, "charger_cut_off"), (2.0, "heal")),
    "HELD → QUALIFYING": _script(HALF, (3.0, "stop"), (5.0, "start")),
    "STARTING → HELD": _script(HALF, (0.0, "charger_cut_off"), (1.5, "stop"), (2.0, "heal")),
    "HELD → OFFLINE → HELD": _script(HALF, (3.0, "stop"), (4.0, "charger_cut_off"), (7.0, "heal")),
    "HELD → SUSPENDED": _script(HALF, (3.0, "stop"), (4.0, "under_temperature"), (13.0, "start")),
    "QUALIFYING → IDLE": _script(HALF, (3.0, "implausible_soc", 99.0)),
    "IDLE → HELD → IDLE → OFFLINE": _script(IDLES, (4.0, "stop"), (5.0, "start"), (6.0, "charger_cut_off")),
    "QUALIFYING → HELD → OFFLINE → TRIPPED → HELD": _script(
        HALF, (3.0, "stop"), (4.0, "charger_cut_off"), (5.5, "status_bits"), (8.0, "heal"),
        (16.0, "reset")
    ),
    "QUALIFYING → OFFLINE": _script(HALF, (3.0, "bmu_reboot")),
    "IDLE → SUSPENDED → IDLE": _script(IDLES, (4.0, "pause"), (6.0, "start")),
    "SUSPENDED → OFFLINE": _script(HALF, (5.0, "pause"), (7.0, "charger_cut_off")),
}  # fmt: skip
