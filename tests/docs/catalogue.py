"""The fault catalogue: every fault by its number, in words, and where it is handled if by no row of the table alone."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Entry:
    """One fault; the rows of the table that name its number are found by it."""

    number: str
    about: str
    also: str = ""  #: what else handles it, or why no row does


CATALOGUE: tuple[Entry, ...] = (
    Entry("C1", "reverse polarity"),
    Entry("C2", "contradictory polarity"),
    Entry("C3", "error stop"),
    Entry("C4", "system stop that nobody asked for"),
    Entry("C5", "charger runs uncommanded"),
    Entry("C6", "charger will not stop", "repeated every 500 ms for ever; UNCONTROLLABLE and its alarm after 3 s"),
    Entry("C7", "charger will not start"),
    Entry("C8", "control mode taken over"),
    Entry("C9", "limit not applied"),
    Entry("C10", "over-voltage"),
    Entry("C11", "over-current", "after a step down its current has 1 s to follow"),
    Entry("C12", "back-feed"),
    Entry("C13", "open circuit"),
    Entry("C14", "no battery found"),
    Entry("C15", "recovery or precharge too long"),
    Entry("C16", "wrong precharge setting"),
    Entry("C17", "time or charge too much", "a charge that begins above SOC 20 % may take that much less"),
    Entry("C18", "full too early or too late",
          "too late cannot come: `finish.soc_pct` is 100 % at most, and a charge ends in the step that shows it"),
    Entry("C19", "undocumented value or transition", "the value is thrown away; mode 8 latches, whatever follows it"),
    Entry("C20", "frozen charger",
          "only while the BMU's values move: a good supply on a flat cell shows the same digits for long"),
    Entry("C21", "error frame: length or checksum", "what was not heard is repeated in the next slot"),
    Entry("C22", "error frame: command or order"),
    Entry("C23", "charger silent", "five polls without an answer (three if answers come late); stopped blindly"),
    Entry("C24", "noise, partial, late or echoed frames",
          "`protocol/frame.py`, `devices/dialogue.py`: thrown away and counted; when nothing else comes, as C23"),
    Entry("C25", "port gone, stolen or wrong", "reopened every second, and then stopped first"),
    Entry("B1", "BMU silent"),
    Entry("B2", "late answer, stale value", "`devices/sdo_client.py` lets no late answer pass for a fresh one"),
    Entry("B3", "SDO abort: object missing"),
    Entry("B4", "SDO abort: not now"),
    Entry("B5", "malformed SDO answers", "`devices/sdo_client.py`: none is accepted, so that it is silent"),
    Entry("B6", "heartbeat lost"),
    Entry("B7", "boot-up in mid-charge"),
    Entry("B8", "not operational", "started again with each heartbeat that says so; only where TPDOs are wanted"),
    Entry("B9", "status word, EMCY"),
    Entry("B10", "hot"),
    Entry("B11", "cold", "gently when cool: the policy's `current.temperature_c`"),
    Entry("B12", "thermal runaway"),
    Entry("B13", "temperature sensor invalid or stuck",
          "a stuck one is not found: see below"),
    Entry("B14", "pack voltage too high or too low"),
    Entry("B15", "volts of charger and BMU differ"),
    Entry("B16", "amps of charger and BMU differ"),
    Entry("B17", "SOC or SOH implausible", "one doubt warns, two together stop"),
    Entry("B18", "another battery", "a BMU that boots, or that was seen to leave, is qualified from the beginning; its "
          "manual has no identity object, `probe` shows what there is"),
    Entry("B19", "two nodes with one id, babble", "`devices/node_health.py`: its answers count for none"),
    Entry("B20", "TPDO and SDO differ",
          "`devices/polled.py`: after two reads, 2 s, neither is believed, as if out of range; until then each of "
          "them is judged as it comes, so that the worse one stops: sooner than the catalogue's 5 s"),
    Entry("B21", "bus off, down, no acknowledge", "`link/can.py`; the bus is opened anew every second"),
    Entry("B22", "receive thread dead",
          "`devices/bus.py` has no thread but its own; if it ends or hangs, the guardian acts as for G2"),
    Entry("G1", "crash, out of memory, SIGKILL", "`service/guardian.py`: stops and verifies every charger"),
    Entry("G2", "hang, deadlock, SIGSTOP", "`service/guardian.py`: no heartbeat for 0.5 s: kills, then as G1"),
    Entry("G3", "guardian dead", "`service/guarded.py`: the controller stops and ends; `deploy/`: ExecStopPost"),
    Entry("G4", "SIGTERM, shutdown", "`service/supervisor.py`: stops, verifies for 3 s, ends"),
    Entry("G5", "exception in our own code"),
    Entry("G6", "steps that come late"),
    Entry("G7", "clock jump, suspended machine", "ages are monotonic: the wall clock may jump as it likes"),
    Entry("G8", "disk full, log blocked", "charging goes on, and `status` says it; a lost list of latched faults, "
          "`service/store.py`, holds every bay"),
    Entry("G9", "two services", "`link/serial.py` (lock of the port), `service/control.py` (socket): the second ends"),
    Entry("G10", "power lost in mid-charge", "`service/store.py`: a charge that nobody ended is not resumed"),
    Entry("P1", "bad policy", "`config/`: refused with every error's line; `run` does not start"),
    Entry("P2", "policy changed while charging", "read anew on SIGHUP, taken over by a bay when it stands by"),
    Entry("P3", "policy of another battery or charger", "`config/station_rules.py`: station and policy must agree"),
    Entry("P4", "operator's stop, emergency stop", "`core/operator.py`: from any state; `service/estop.py`: alone"),
    Entry("P5", "start while latched or unknown", "`core/operator.py`: refused, and the cause named"),
    Entry("P6", "resets without a remedy", "`core/operator.py`: the fourth within an hour is refused, with the time"),
    Entry("P7", "control socket: strangers, floods",
          "`service/control.py`: owner and root only, one after another, 50 a second; who is turned away is said"),
)  # fmt: skip
