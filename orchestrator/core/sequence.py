"""How a charger is brought to a setpoint: one command at a time, each seen in a status reply before the next.

Manual mode: resume (rest 1) → current step → mode → precharge function → run. Automatic mode: resume only. A command
stands until its read-back ends it, and the port repeats it meanwhile, so a lost frame costs one slot. A resume has no
read-back of its own: it counts once a reply was asked for after it was sent. If what follows is not obeyed, the lost
frame may have been the resume, so the sequence begins again with it.
"""

from orchestrator.core.facts import Facts
from orchestrator.core.memory import Sequence
from orchestrator.core.parts import changed
from orchestrator.model import Action, ChargeMode, ChargerReading, Command, Operation, Setpoint

#: Without a read-back for this long, begin again with the resume.
RETRY_S = 1.5
RESUME = Command(Action.RESUME)
RUN = Command(Action.RUN)
#: What a charger that was told to run may show before the commanded mode.
ON_THE_WAY = (ChargeMode.BATTERY_SEARCH, ChargeMode.BATTERY_RECOVERY)


def next_command(f: Facts, setpoint: Setpoint) -> tuple[Command | None, Sequence]:
    """The next command towards `setpoint`, None when the status shows all of it; and how far the sequence has come."""
    known, reading = f.memory.sequence, f.reading
    if reading is None:
        return known.command, known
    missing = _missing(reading, setpoint, manual=f.rules.manual)
    if missing != known.command:
        known = changed(known, command=missing, command_s=f.now_s, tries=0)
    if missing is None or _running(reading):
        return missing, known
    if f.memory.stage.ran:
        return None, known  # somebody stopped it: the fault table decides
    if not known.resumed and _resume_seen(f, reading):
        known = changed(known, resumed=True)
    tries = int((f.now_s - known.command_s) / RETRY_S)
    if tries > known.tries:
        known = changed(known, tries=tries, resumed=False, resume_s=f.now_s)
    return (missing if known.resumed else RESUME), known


def begins(known: Sequence, now_s: float) -> Sequence:
    """Current is to flow after a rest."""
    return changed(known, resumed=False, resume_s=now_s, command=None)


def ends(known: Sequence) -> Sequence:
    """Current is no longer to flow."""
    return changed(known, command=None) if known.command is not None else known


def _running(reading: ChargerReading) -> bool:
    return reading.operation is Operation.RUNNING


def _resume_seen(f: Facts, reading: ChargerReading) -> bool:
    sent = f.charger.sent
    return sent is not None and sent.command == RESUME and f.memory.sequence.resume_s <= sent.t_s < reading.t_s


def _missing(reading: ChargerReading, setpoint: Setpoint, *, manual: bool) -> Command | None:
    """The command for the first value of the setpoint that the status does not show."""
    running = _running(reading)
    if not manual:
        return None if running else RESUME
    if setpoint.current_step is not None and reading.current_step != setpoint.current_step:
        return Command(Action.SET_LIMIT, setpoint.current_step)
    if setpoint.charge_mode is not None and reading.charge_mode is not setpoint.charge_mode:
        under_way = running and reading.charge_mode in ON_THE_WAY
        if not under_way:
            return Command(Action.SET_MODE, setpoint.charge_mode)
    if setpoint.precharge is not None and reading.precharge is not setpoint.precharge:
        return Command(Action.SET_PRECHARGE, setpoint.precharge)
    return None if running else RUN
