"""Invariants of wire and plant, whatever happens to the station; our own output counts only as a claim.

1. Current flows only under a command allowed now (`REASONS`: facts of the plant that allow none).
2. An intended stop is understood by a charger that can hear, within its budget, whatever other ports do.
3. Nothing waiting for a person energises by itself, over any number of lives.
4. A bay reported as stopped, verified or at rest is so; one that cannot be stopped is reported so.

Nobody can see through a lie told by both witnesses: nothing is required there. A temperature has one witness only, the
BMU.
"""

import json
import re
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from orchestrator.core.states import ENERGISED
from orchestrator.model import ChargeMode, ControlMode, State
from orchestrator.sim.charger_frames import Kind
from tests.proof.claims import Told, claims, record, starts
from tests.proof.gateway import SMALL_AH, SMALL_RISE_S, STEPS_A, Asked, Gateway, port_name
from tests.proof.hazards import BEGIN_S, Bay, Script
from tests.proof.isolation import contactor_moves, isolates, left_on
from tests.proof.virtual_rig import VirtualRig

STOP, OPERATION_0 = bytes.fromhex("AFFA900410900034AFA0"), bytes.fromhex("AFFA90050290010028AFA0")
OPERATION_1, RESUME = bytes.fromhex("AFFA90050290010129AFA0"), bytes.fromhex("AFFA90041090 0135AFA0")
LIMIT = re.compile(re.escape(bytes.fromhex("AFFA9005029002")) + b"(.)", re.DOTALL)

#: An output below this counts as none; a current above it is visible to all.
FLOWS_A, SEEN_A = 0.5, 1.0
#: "Device falls silent or its line is reconfigured → stop understood", "stop not verified → UNCONTROLLABLE", and the
#: time noticing it may take: a repetition, a poll, a status.
LINE_S, VERIFY_S, MARGIN_S = 2.0, 3.0, 1.4
#: An opened port sends its first stop within this.
OPEN_S = 2.0
#: A stop is understood within this after an operator's answer or the end of a process.
ASKED_S, KILLED_S, FROZEN_S, TERM_S, ESTOP_S = 0.6, 0.25, 1.2, 0.7, 0.5
#: The control socket exists this long after the start, and answers within that.
START_S, ANSWER_S = 1.5, 6.0
#: The period over which current is compared with its setpoint.
MEAN_S = 12.0
#: A charger running again this often within that time, without a command, was not stopped and is reported so.
RESTARTS, RESTARTS_S = 3, 25.0
#: A latch this old is on the disk.
KEPT_S = 2.6
#: Another program's effect on a charger shows in the next sample.
GRACE_S = 0.6
VERIFIED = re.compile(r"standby verified|stands? by, verified|verified (?:standby|to stand by)", re.IGNORECASE)
DENIED = re.compile(r"NOT|not verified|no proof")


@dataclass(slots=True)
class Charger:
    """One charger of the plant and the data on its bay."""

    number: int
    rig: VirtualRig
    meant: str = ""  #: the last command our processes wrote to its port: "run", "stop"; "" none in this life
    meant_s: float = 0.0
    told_s: float = 0.0  #: when it was first told to stop after being told to run
    limit: int = 4  #: the last current limit written
    deaf_s: float = 0.0  #: when it last could not hear or be reached
    since_s: dict[str, float] = field(default_factory=dict)  #: reason → since when it holds while current flows
    named_s: float = 0.0  #: when it was last reported as out of control
    waits: dict[str, str] = field(default_factory=dict)  #: for a person: why, in words
    tripped_s: float | None = None  #: since when the status is TRIPPED
    asked_stop: bool = False  #: an operator's stop was accepted, with no start since
    flown: deque[tuple[float, float, float]] = field(default_factory=lambda: deque(maxlen=300))
    stopped_s: float = 0.0  #: when a stop was last understood at its port
    looked_s: float = 1000.0
    charged_ah: float = 0.0
    thawed: tuple[float, float] = (0.0, 0.0)  #: Ah and volts at the last change of its BMU's values
    precharged_s: float = 0.0
    told: Told = field(default_factory=Told)  #: the status of it
    strange_s: float = 0.0  #: when another program's frame switched it on or off
    stood_s: float = 0.0  #: since when its output is off
    onsets: deque[float] = field(default_factory=lambda: deque(maxlen=RESTARTS))  #: when it ran again without a command

    @property
    def flows(self) -> bool:
        return bool(self.rig.bay.charger.running or self.rig.bay.charger.current_a > FLOWS_A)

    @property
    def current_a(self) -> float:
        return float(self.rig.bay.charger.current_a)

    @property
    def obeys(self) -> bool:
        charger = self.rig.bay.charger
        return not (
            charger.ignores_stop or charger.stops_left < 1 or charger.restless_s is not None or charger.rogue
        )  # fmt: skip

    def honest(self, kind: Kind, *fields: str) -> bool:
        """At least one of the two witnesses is truthful."""
        wire, bay = self.rig.wire, self.rig.bay
        charger_honest = kind not in wire.lies and kind not in wire.liars and not wire.mute_tx
        bmu_honest = not set(fields) & set(bay.falsify) and not self.rig.bmu.port.faults.mute
        return charger_honest or bmu_honest

    @property
    def seen(self) -> bool:
        """At least one witness is truthful about the current."""
        wire = self.rig.wire
        charger = not {Kind.OPERATION, Kind.CURRENT} & {*wire.lies, *wire.liars} and not (wire.mute_tx or wire.mute_rx)
        faults = self.rig.bmu.port.faults
        return charger or ("current_a" not in self.rig.bay.falsify and not faults.mute and faults.delay_s < 0.3)


@dataclass(frozen=True, slots=True)
class Reason:
    """A fact of the plant that allows no current for longer than `within_s`."""

    name: str
    within_s: float
    holds: Callable[["Judge", Charger], bool]


def _temperature_honest(charger: Charger) -> bool:
    """Frames forged in the BMU's name are no excuse: the BMU answers too, and differently."""
    return "temperature_c" not in charger.rig.bay.falsify


def _volts(charger: Charger) -> bool:
    return charger.rig.bay.charger.voltage_v > 55.3 and charger.honest(Kind.VOLTAGE, "voltage_v")


def _crossed(judge: "Judge", charger: Charger) -> bool:
    entry = judge.entry(charger)
    return charger.rig.wire.charger is not charger.rig.bay.charger or (entry is not None and entry.node != entry.port)


def _hot(_: "Judge", charger: Charger) -> bool:
    return charger.rig.bay.pack.temperature_c > 45.2 and _temperature_honest(charger)


def _cold(_: "Judge", charger: Charger) -> bool:
    return charger.rig.bay.pack.temperature_c < -0.2 and _temperature_honest(charger)


def _frozen(judge: "Judge", charger: Charger) -> bool:
    """Its BMU's values are frozen, and the charge since then proves it: 1 Ah, or 0.3 V more."""
    rig = charger.rig
    if not rig.frozen:
        charger.thawed = charger.charged_ah, rig.bay.charger.voltage_v
    ah, volts = charger.thawed
    return rig.frozen and (charger.charged_ah - ah > 1.0 or abs(rig.bay.charger.voltage_v - volts) > 0.3)


def _another(_: "Judge", charger: Charger) -> bool:
    """A pack reporting nearly empty may be a deeply discharged one of the right kind: indistinguishable."""
    pack = charger.rig.bay.pack
    return pack.cells != 13 and pack.soc > 0.1 and not charger.rig.bay.falsify


def _collapsed(_: "Judge", charger: Charger) -> bool:
    """A nearly empty pack that collapsed at rest looks deeply discharged and is precharged."""
    pack, precharged = charger.rig.bay.pack, charger.rig.bay.charger.mode is ChargeMode.PRECHARGE
    known = pack.soc > 0.1 or not precharged
    return pack.bias_v < -8.0 and known and charger.honest(Kind.VOLTAGE, "voltage_v")


def _too_much(judge: "Judge", charger: Charger) -> bool:
    entry = judge.entry(charger)
    limit_a = (entry.limit_a if entry else 15.0) * 1.1 + 0.8
    return charger.current_a > limit_a and charger.seen


def _deep(_: "Judge", charger: Charger) -> bool:
    """A pack at the bottom of its deep discharge gets at most a precharge; an automatic charger ensures that itself."""
    model = charger.rig.bay.charger
    volts = model.voltage_v < 33.0 and charger.honest(Kind.VOLTAGE, "voltage_v")
    return volts and charger.current_a > 1.5 * model.precharge_a


#: Only the first amperes show crossed cables; until then a pack is watched by another pack's BMU.
CROSSED_S = 9.0
#: Facts visible on the charger's own line, whichever pack it charges.
BY_CHARGER = frozenset({"no order", "operator's stop", "over-current", "over-voltage"})

REASONS: tuple[Reason, ...] = (
    Reason("no order", LINE_S, lambda judge, c: judge.by(c).meant != "run" and not judge.wants(c)),
    Reason("operator's stop", ASKED_S, lambda _, c: c.asked_stop),
    Reason("hot", LINE_S, _hot),
    Reason("cold", LINE_S, _cold),
    Reason("over-voltage", LINE_S, lambda _, c: _volts(c)),
    Reason("over-current", LINE_S, _too_much),
    Reason("BMU silent", LINE_S, lambda _, c: c.rig.bmu.port.faults.mute),
    Reason("another pack", LINE_S + 3.0, _another),
    Reason("collapsed", LINE_S, _collapsed),
    Reason("crossed", CROSSED_S, _crossed),
    Reason("BMU frozen", 62.0, _frozen),
    Reason("apart, most of the time", 20.0, lambda _, c: c.rig.apart_v > 1.2),
    Reason("deep", LINE_S, _deep),
    Reason("status word", LINE_S, lambda _, c: "status" in c.rig.bay.falsify and _trips(c)),
)


#: Permitted reads and writes by others on bus and line: no reason to stop.
HARMLESS = ("boot", "tool", "term", "stderr", "late", "clock")
#: Verified standby, and not told to run.
AT_REST = {state.name for state in (State.IDLE, State.FULL, State.SUSPENDED, State.TRIPPED)}
#: A charger run at rest, or stopped in mid-charge, by another program waits for a person after this.
HELD_S, STATUS_S = 3.0, 0.25
#: Within this after the last start every bay charges.
GOES_ON_S = 2 * BEGIN_S


def _is_json(line: bytes) -> bool:
    try:
        json.loads(line)
    except ValueError:
        return False
    return True


def _trips(charger: Charger) -> bool:
    return bool(int(charger.rig.bay.readout().status) & (1 << 0 | 1 << 2 | 1 << 4 | 1 << 6)) and charger.rig.steady


class Judge:
    """Follows one script; `wrong` are the findings, "t = …, charger n, invariant: what"."""

    def __init__(self, gateway: Gateway, script: Script) -> None:
        self.gateway, self.script = gateway, script
        self.time = gateway.time
        self.began_s = self.time.now_s
        self.wrong: list[str] = []
        self.chargers = [Charger(number, rig) for number, rig in enumerate(gateway.rigs)]
        self.life = list(gateway.entries)  #: what the running service has read
        self.life_began_s: float | None = None
        self.booted_s: float | None = None  #: when the current life began; None: no service runs
        self.status: Mapping[str, Any] | None = None
        self.status_s = 0.0
        self.frozen = False
        self._read = 0  # log lines
        for charger in self.chargers:
            charger.rig.tty.on_written = partial(self._written, charger)
            charger.rig.wire.on_started = partial(self._started, charger)
            charger.rig.wire.on_stranger = partial(self._stranger, charger)
            if charger.rig.breaker is not None:
                charger.rig.breaker.on_moved = partial(self._moved, charger)

    def entry(self, charger: Charger) -> Any:
        """The bay with this charger's port in the current life."""
        return next((entry for entry in self.life if entry.port == charger.number), None)

    def by(self, charger: Charger) -> Charger:
        """The port this charger is wired to: its own, unless cables are crossed."""
        model = charger.rig.bay.charger
        return charger if charger.rig.wire.charger is model else next(
            one for one in self.chargers if one.rig.wire.charger is model
        )  # fmt: skip

    def wants(self, charger: Charger) -> bool:
        """The service reports charging here: a charger already running need not be told to."""
        return self._shown(charger).get("state") in ENERGISED and self.time.now_s - self.status_s < 1.0

    def find(self, charger: int, name: str, text: str) -> None:
        if not any(f" {name}: " in line for line in self.wrong):
            whose = f"charger {charger + 1}" if charger >= 0 else "the service"
            self.wrong.append(f"t = {self.time.now_s - self.began_s:.2f} s, {whose}, {name}: {text}")

    # --- what comes over the wires ------------------------------------------------------------------------------------

    def _written(self, charger: Charger, data: bytes) -> None:
        if STOP in data or OPERATION_0 in data:
            charger.told_s = charger.told_s if charger.meant == "stop" else self.time.now_s
            charger.meant, charger.meant_s = "stop", self.time.now_s
        elif OPERATION_1 in data or (RESUME in data and charger.rig.as_built.control_mode is ControlMode.AUTOMATIC):
            charger.meant, charger.meant_s = "run", self.time.now_s
            charger.told.ran_s = self.time.now_s
        if limit := LIMIT.search(data):
            charger.limit = limit[1][0]

    def _started(self, charger: Charger, _now_s: float) -> None:
        """A frame switched on the output of the charger behind this port."""
        for name, text in starts(self, charger):
            self.find(charger.number, name, text)
        if charger.waits:
            self.find(charger.number, "by itself", f"it was started, and waits for a person: {charger.waits}")
        if self.booted_s is None or charger.meant_s < self.booted_s:
            self.find(charger.number, "by itself", "it was started by nobody")

    def _stranger(self, charger: Charger, ran: bool) -> None:
        """A frame of another program switched an output on or off."""
        charger.strange_s = self.time.now_s
        state = self._shown(charger).get("state", "")
        at_rest, fresh = state in AT_REST, self.time.now_s - self.status_s < 2 * STATUS_S
        if ran and at_rest and fresh and charger.meant != "run":
            self.time.call_later(HELD_S, self._latched, charger, self.time.now_s, self.booted_s)
        elif not ran and state in ENERGISED and charger.meant == "run" and charger.current_a > FLOWS_A:
            self.time.call_later(HELD_S, self._held, charger, self.time.now_s)

    def _latched(self, charger: Charger, since_s: float, booted_s: float | None) -> None:
        """Fault C5: a charger run by somebody else at rest waits for a person."""
        shown = self._shown(charger)
        undisturbed = charger.strange_s == since_s and charger.deaf_s < since_s and not charger.rig.wire.mute_tx
        told = booted_s == self.booted_s and self.time.now_s - self.status_s < 1.0
        held = "operator" in charger.waits or shown.get("state") in ("TRIPPED", "UNCONTROLLABLE", "STOPPING")
        if undisturbed and told and charger.obeys and not held:
            self.find(charger.number, "latched", f"another program has run it, {self._state(charger)}")

    def _held(self, charger: Charger, since_s: float) -> None:
        """Fault C4: a charger stopped by somebody else in mid-charge waits for a person."""
        if charger.strange_s == since_s and not charger.flows:
            charger.waits["stranger"] = "another program has stopped it"

    def _moved(self, charger: Charger, closed: bool) -> None:
        charger.rig.catch_up(force=True)
        for name, text in contactor_moves(self, charger, closed=closed):
            self.find(charger.number, name, text)

    def forgotten(self) -> None:
        """The persisted state is damaged: the latches are unknown."""
        for charger in self.chargers:
            charger.waits["past"] = "its past cannot be read"

    # --- what people are told, and ask --------------------------------------------------------------------------------

    def told(self, asked: Asked) -> None:
        """A status."""
        if asked.answer is None:
            return
        self.status, self.status_s = asked.answer, self.time.now_s
        for bay in asked.answer["bays"]:
            charger = self._of(bay["name"])
            if charger is None:
                continue
            for name, text in claims(self, charger, bay):
                self.find(charger.number, name, text)
            if bay["alarm"] == "danger":
                charger.named_s = self.time.now_s
            if bay["state"] == "TRIPPED":
                charger.tripped_s = self.time.now_s if charger.tripped_s is None else charger.tripped_s
                charger.waits["tripped"] = bay["reason"]
            else:
                charger.tripped_s = None

    def _of(self, name: str) -> Charger | None:
        return next((self.chargers[entry.port] for entry in self.life if entry.name == name), None)

    def asked(self, asked: Asked, names: list[str]) -> None:
        """A person's request: a stop counts whatever the answer, and there is an answer."""
        if self.booted_s is None or self.frozen or self.time.now_s < self.booted_s + START_S:
            return
        if asked.request["verb"] == "stop":
            for charger in filter(None, map(self._of, names)):
                self._meant(charger, asked.asked_s, ASKED_S, "an operator asked for a stop")
        self.time.call_later(ANSWER_S, self._unanswered, asked, self.gateway.controller)

    def _unanswered(self, asked: Asked, controller: Any) -> None:
        if asked.answer is None and not asked.error and self.gateway.alive(controller) and not self.frozen:
            self.find(-1, "unanswered", f"nobody answers {asked.request}")

    def answered(self, asked: Asked) -> None:
        """A person's request was answered: "" is yes."""
        verb, results = asked.request["verb"], (asked.answer or {}).get("results", {})
        for name, answer in results.items():
            charger = self._of(name)
            if charger is None or answer:
                continue
            if verb == "stop":
                charger.asked_stop = True
                charger.waits["operator"] = "stopped by the operator"
            elif verb == "start":
                charger.asked_stop = False
                charger.waits.clear()

    # --- lives --------------------------------------------------------------------------------------------------------

    def boots(self) -> None:
        self.life, self.booted_s, self.frozen = list(self.gateway.entries), self.time.now_s, False
        self.status, self.life_began_s = None, self.time.now_s
        for charger in self.chargers:
            charger.meant, charger.limit = "", 4
            charger.since_s.clear()

    def dies(self, why: str, *, orderly: bool = False) -> None:
        """The controller has ended or is told to end."""
        for charger in self.chargers:
            if not orderly and charger.meant == "run" and charger.flows and charger.current_a > FLOWS_A:
                charger.waits["died"] = f"{why} in mid-charge"
            tripped_s = charger.tripped_s
            if tripped_s is not None and self.time.now_s - tripped_s < KEPT_S and "died" not in charger.waits:
                charger.waits.pop("tripped", None)
            charger.tripped_s = None

    def gone(self) -> None:
        """No process of ours is left."""
        self.booted_s = None

    def helped(self) -> None:
        """The station is stopped without a service."""
        self.booted_s = self.time.now_s if self.booted_s is None else self.booted_s

    def meant(self, within_s: float, why: str) -> None:
        """From now on every charger of this life must stop."""
        for charger in self.chargers:
            if self.entry(charger) is not None:
                self._meant(charger, self.time.now_s, within_s, why)

    def _meant(self, charger: Charger, since_s: float, within_s: float, why: str) -> None:
        if charger.meant == "run" and charger.rig.wire.charger.running:
            self.time.call_at(max(since_s + within_s, self.time.now_s), self._understood, charger, since_s, why)

    def _understood(self, charger: Charger, since_s: float, why: str) -> None:
        due_s = charger.rig.tty.changed_s + LINE_S
        if due_s > self.time.now_s:  # the line had other settings just then
            self.time.call_at(due_s, self._understood, charger, since_s, why)
        elif charger.stopped_s < since_s and charger.deaf_s < since_s and self.booted_s is not None:
            self.find(
                charger.number, "not understood", f"{why}, and {self.time.now_s - since_s:.2f} s later it knows of none"
            )

    # --- what must be -------------------------------------------------------------------------------------------------

    def look(self) -> None:
        now_s = self.time.now_s
        for charger in self.chargers:
            charger.rig.catch_up()
        for charger in self.chargers:
            self._reach(charger, now_s)
            if charger.rig.wire.counters.first_stop_s is not None:
                charger.stopped_s = now_s
                charger.rig.wire.counters.mark()
            self._judge(charger, now_s)
            self._judge_mean(charger, now_s)
        self._judge_words()
        self._judge_small(now_s)

    def _judge_small(self, now_s: float) -> None:
        """Limits of a charge hold across restarts."""
        for charger, bay in zip(self.chargers, self.script.bays, strict=True):
            dt_s, charger.looked_s = now_s - charger.looked_s, now_s
            charger.charged_ah += charger.current_a * dt_s / 3600
            if not bay.small:
                continue
            charger.precharged_s += dt_s * (charger.flows and charger.rig.bay.pack.leaky)
            if charger.charged_ah > SMALL_AH * 1.2:
                self.find(charger.number, "limits", f"{charger.charged_ah:.3f} Ah went in, {SMALL_AH:g} are allowed")
            if charger.precharged_s > SMALL_RISE_S * 1.4:
                self.find(charger.number, "limits", f"{charger.precharged_s:.0f} s of precharge without a rise")

    def ends(self) -> None:
        """At the end of the script: harmless events stopped nothing, and the journal is readable."""
        plain = [replace(bay, control="manual", contactor=False) for bay in self.script.bays]
        harmless = all(one.what in HARMLESS for one in self.script.hazards) and plain == [Bay()] * 3
        harmless = harmless and self.gateway.alive(self.gateway.controller)
        began_s = self.began_s if self.life_began_s is None else self.life_began_s
        if harmless and (self.time.now_s - began_s > GOES_ON_S or began_s == self.began_s):
            for charger in self.chargers:
                if not charger.rig.bay.charger.running:
                    self.find(charger.number, "goes on", f"something harmless has stopped it, {self._state(charger)}")
        for name, text in record(self) if self.script.recorded else ():
            self.find(-1, name, text)
        if not any(one.what == "power" for one in self.script.hazards):
            for path, inode in self.gateway.disk.names.items():
                lines = bytes(inode.data).split(b"\n")[:-1] if path.endswith(".jsonl") else []
                if broken := [line for line in lines if not _is_json(line)]:
                    self.find(-1, "record", f"{path} has a line that cannot be read: {broken[0]!r}")

    def _reach(self, charger: Charger, now_s: float) -> None:
        tty, wire = charger.rig.tty, charger.rig.wire
        name = port_name(charger.number)
        troubles = (one for one in self.gateway.kernel.calls.troubles if one.place == name)
        troubled = any(now_s < one.until_s + one.delay_s for one in troubles)
        if not tty.present or tty.stalled or tty.stolen or wire.mute_rx or troubled:
            charger.deaf_s = now_s

    def _judge(self, charger: Charger, now_s: float) -> None:
        for reason in REASONS:
            if not (charger.flows and reason.holds(self, charger)):
                charger.since_s.pop(reason.name, None)
                continue
            since_s = charger.since_s.setdefault(reason.name, now_s)
            if self.booted_s is None or self.entry(charger) is None:
                charger.since_s[reason.name] = now_s
                continue
            port = self.by(charger)
            deaf_s = port.deaf_s + OPEN_S if port.deaf_s else 0.0
            reached_s = max(since_s, self.booted_s + OPEN_S, deaf_s, port.rig.tty.changed_s)
            blind = reason.name not in BY_CHARGER and _crossed(self, charger)
            within_s = max(reason.within_s, CROSSED_S) if blind else reason.within_s
            if charger.obeys and now_s - reached_s > within_s:
                self.find(
                    charger.number, reason.name, f"current flows for {now_s - since_s:.2f} s, {self._state(charger)}"
                )
            self._judge_named(charger, reason, since_s, now_s)
        self._judge_restless(charger, now_s)
        charger.stood_s = 0.0 if charger.flows else charger.stood_s or now_s
        for name, text in left_on(self, charger) if isolates(self, charger) else ():
            self.find(charger.number, name, text)

    def _judge_restless(self, charger: Charger, now_s: float) -> None:
        """A charger that is stopped and runs again repeatedly was never stopped."""
        if charger.since_s.get("no order") == now_s and charger.seen:
            charger.onsets.append(now_s)
        onsets = charger.onsets
        if self.booted_s is None or self.entry(charger) is None or len(onsets) < RESTARTS or onsets[0] < self.booted_s:
            return
        if self.frozen or not self.gateway.alive(self.gateway.controller):  # no service to report it
            return
        if now_s - onsets[0] < RESTARTS_S and charger.named_s < onsets[0] and now_s - onsets[-1] > VERIFY_S:
            self.find(charger.number, "nobody is told", f"it runs again and again by itself, {self._state(charger)}")

    def _judge_named(self, charger: Charger, reason: Reason, since_s: float, now_s: float) -> None:
        """A charger that cannot be stopped is reported so."""
        if charger.current_a < SEEN_A or not charger.seen or not self.gateway.alive(self.gateway.controller):
            return
        if self.booted_s is None or self.frozen or now_s - self.status_s > 1.0 or reason.name == "crossed":
            return
        unnamed_s = now_s - max(since_s, self.booted_s + OPEN_S, charger.named_s)
        if unnamed_s > reason.within_s + VERIFY_S + MARGIN_S:
            self.find(
                charger.number,
                "nobody is told",
                f"{reason.name}: it runs for {unnamed_s:.2f} s, {self._state(charger)}",
            )

    def _judge_mean(self, charger: Charger, now_s: float) -> None:
        """The average current is at most the setpoint."""
        port = self.by(charger)
        ordered_a = STEPS_A[min(port.limit, 4)] if port.meant == "run" else 20.0
        flown = charger.flown
        flown.append((now_s, charger.current_a, ordered_a))
        while flown and now_s - flown[0][0] > MEAN_S:
            flown.popleft()
        if now_s - flown[0][0] < MEAN_S - 0.2 or charger.rig.bay.charger.mode is not ChargeMode.CHARGE:
            return
        mean_a, most_a = sum(one[1] for one in flown) / len(flown), max(one[2] for one in flown)
        if mean_a > most_a * 1.1 + 1.5 and charger.seen and charger.obeys and now_s - charger.deaf_s > MEAN_S:
            self.find(
                charger.number,
                "more than ordered",
                f"{mean_a:.1f} A in the mean of {MEAN_S:g} s, {most_a:g} A were ordered",
            )

    def _state(self, charger: Charger) -> str:
        shown = self._shown(charger)
        return f"{shown['state']}: {shown['reason']}" if shown else "and no status tells of it"

    def _shown(self, charger: Charger) -> Mapping[str, Any]:
        """The bay in the newest status."""
        entry = self.entry(charger)
        bays = self.status["bays"] if self.status is not None else []
        return next((bay for bay in bays if entry is not None and bay["name"] == entry.name), {})

    # --- words --------------------------------------------------------------------------------------------------------

    def _judge_words(self) -> None:
        for line in self.gateway.said[self._read :]:
            if "internal" in line.text or "Traceback" in line.text:
                self.find(-1, "exception", f"{line.process}: {line.text}")
            if VERIFIED.search(line.text) and not DENIED.search(line.text):
                self._judge_claim(line.process, line.text)
        self._read = len(self.gateway.said)
        for process in self.gateway.processes.all.values():
            for text in process.said:
                self.find(-1, "exception", text)

    def _judge_claim(self, process: str, text: str) -> None:
        for charger in self.chargers:
            entry = self.entry(charger)
            named = port_name(charger.number) in text
            if entry is not None and not any(port_name(one.number) in text for one in self.chargers):
                named = re.search(rf"\b{entry.name}\b", text) is not None  # not another bay's name by now
            if not (named or "every charger" in text) or charger.current_a < SEEN_A or entry is None:
                continue
            if self.time.now_s - charger.strange_s < GRACE_S:
                continue
            alone = process == "guardian" or self.gateway.door is None  # has only the charger as a witness
            lies = {*charger.rig.wire.lies, *charger.rig.wire.liars} & {Kind.OPERATION, Kind.CURRENT}
            if not lies if alone else charger.seen:
                self.find(charger.number, "verified", f"{process} says {text!r}, and {charger.current_a:.1f} A flow")

    def ended(self, name: str, status: int) -> None:
        """A process ended cleanly: with status 0, nothing flows."""
        if name in ("controller", "guardian", "estop") and status == 0:
            for charger in self.chargers:
                if self.entry(charger) is None or charger.current_a < SEEN_A:
                    continue
                lies = {*charger.rig.wire.lies, *charger.rig.wire.liars} & {Kind.OPERATION, Kind.CURRENT}
                if charger.seen if name == "controller" else not lies:
                    self.find(
                        charger.number, "verified", f"{name} has ended with 0, and {charger.current_a:.1f} A flow"
                    )
