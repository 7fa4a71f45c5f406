"""Plays a script of `hazards.py` on a whole station over the lives of its gateway; the result is a `Lived`."""

import errno
import signal
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import Any

import can

from orchestrator.model import ControlMode
from orchestrator.sim.charger_frames import Kind, Lie
from orchestrator.sim.faults import FAULTS
from orchestrator.sim.pack import Pack
from orchestrator.sim.rig import cross_cables
from orchestrator.sim.second_master import SecondMaster
from tests.proof import program
from tests.proof.gateway import CHIP, FIRST_NODE, JOURNAL, Entry, Gateway, port_name
from tests.proof.hazards import FOR_EVER, Hazard, Script
from tests.proof.judge import ESTOP_S, FROZEN_S, KILLED_S, TERM_S, Judge
from tests.proof.virtual_calls import Trouble
from tests.proof.virtual_descriptors import STDERR
from tests.proof.virtual_process import Process
from tests.proof.virtual_rig import ANSWER_S, Nature

LOOK_S, STATUS_S = 0.05, 0.25
#: systemd waits this long before restarting the service.
RESTART_S = 2.0


#: The delay of a charger that answers late, but within the deadline of 120 ms.
LATE_S = (0.060, 0.119)
#: After these the service may end.
EXCUSES = ("term", "kill", "kill guardian", "kill both", "freeze", "power")


@dataclass(slots=True)
class Lived:
    """The result of a script."""

    script: Script
    wrong: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    charged: int = 0  #: number of chargers that have run

    @property
    def kinds(self) -> set[str]:
        """The broken invariants: "t = 1.00 s, charger 1, hot: …" is "hot"."""
        return {line.split(", ", 2)[2].split(":")[0] for line in self.wrong}


class Player:
    """One script on one station."""

    def __init__(self, script: Script) -> None:
        self.script = script
        battery: dict[str, Any] = {"tpdo_s": 0.1} if script.tpdo else {}
        self.gateway = Gateway(
            [_nature(bay, number) for number, bay in enumerate(script.bays)],
            entries(script),
            seed=script.seed, end_s=script.end_s + 30.0, snapshots=script.recorded, **battery,
        )  # fmt: skip
        self.time = self.gateway.time
        self._cross()
        self.judge = Judge(self.gateway, script)
        self.began_s = self.time.now_s
        self.gateway.on_end = self._ended
        self._wanted = False  # the service should run
        self._excused = False  # an event after which it may end
        self._charged: set[int] = set()

    def _cross(self) -> None:
        for number, bay in enumerate(self.script.bays):
            if bay.cross > number:
                cross_cables(self.gateway.rigs[number], self.gateway.rigs[bay.cross])

    def run(self) -> Lived:
        lived = Lived(self.script)
        for hazard in self.script.hazards:
            self.time.call_at(self.began_s + hazard.t_s, self._happen, hazard)
        self.time.call_later(LOOK_S, self._look)
        self.time.call_later(STATUS_S, self._ask_status)
        try:
            self.time.wait(self.began_s + self.script.end_s)
        except BaseException:  # noqa: BLE001 - a broken world is the worst finding
            error = self.time.failure
            where = traceback.extract_tb(error.__traceback__)[-1] if error and error.__traceback__ else None
            self.judge.find(-1, "exception", f"{error!r} in {where and where.name}, {where and where.filename}")
        finally:
            self.gateway.close()
        self.judge.ends()
        lived.wrong, lived.charged = self.judge.wrong, len(self._charged)
        lived.said = [f"{one.t_s - self.began_s:8.3f} {one.process}: {one.text}" for one in self.gateway.said]
        return lived

    def _look(self) -> None:
        self.time.call_later(LOOK_S, self._look)
        self.judge.look()
        self._charged |= {number for number, rig in enumerate(self.gateway.rigs) if rig.bay.charger.running}

    def _ask_status(self) -> None:
        self.time.call_later(STATUS_S, self._ask_status)
        if not self.judge.frozen:
            self.gateway.ask({"verb": "status"}, self.judge.told)

    # --- what happens -------------------------------------------------------------------------------------------------

    def _happen(self, hazard: Hazard) -> None:
        call, place = (*hazard.detail.split(":"), "")[:2]
        hangs = hazard.what == "slow" and place in ("port", "chip") and call not in ("open", "close")
        self._excused = self._excused or hangs or hazard.what in EXCUSES
        getattr(self, f"_{hazard.what.replace(' ', '_')}")(hazard)

    def _rigs(self, hazard: Hazard) -> list[Any]:
        rigs = self.gateway.rigs
        return rigs if hazard.bay < 0 else rigs[hazard.bay : hazard.bay + 1]

    def _boot(self, _: Hazard | None = None) -> None:
        self._wanted = True
        if not self.gateway.alive(self.gateway.service):
            self.judge.boots()
            self.gateway.boot()

    def _ended(self, process: Process) -> None:
        """One of our processes ended by itself."""
        if process in (self.gateway.controller, self.gateway.service) and not self._excused:
            self.judge.find(-1, "ended", f"{process.name}, though nobody wanted it to, and no thread of it could hang")
        self.judge.ended(process.name, process.status if process.status is not None else self.gateway.ended[-1].status)
        if process is self.gateway.controller:
            self.judge.dies("the controller has ended", orderly=self.gateway.ended[-1].status == 0)
        if process is self.gateway.service:
            self._after(self.gateway.ended[-1].status)

    def _after(self, status: int) -> None:
        """The service has ended: systemd's turn."""
        if self.script.systemd:
            self.gateway.estop(str(self.gateway.station_file), "--leave-held")
            if self._wanted and status:
                self.time.call_later(RESTART_S, self._boot)
        else:
            self.time.call_later(0.2, self._nobody)

    def _nobody(self) -> None:
        if not any(self.gateway.alive(one) for one in self.gateway.processes.all.values()):
            self.judge.gone()

    def _term(self, _: Hazard) -> None:
        self._wanted = False
        if self.gateway.alive(self.gateway.service):
            self.judge.meant(TERM_S, "the service was told to end")
            self.gateway.signal(self.gateway.service, signal.SIGTERM)

    def _kill(self, _: Hazard) -> None:
        if self.gateway.alive(self.gateway.controller):
            self.judge.dies("the controller was killed")
            # A process with a thread in a driver does not die at once, but falls silent.
            hangs = self.gateway.controller is not None and self.gateway.controller.hangs
            self.judge.meant(FROZEN_S if hangs else KILLED_S, "the controller was killed")
            self.gateway.signal(self.gateway.controller, signal.SIGKILL)

    def _kill_guardian(self, _: Hazard) -> None:
        guardian = self.gateway.service
        if self.gateway.alive(guardian):
            self.gateway.signal(guardian, signal.SIGKILL)
            if self.script.systemd:
                self.time.call_later(0.05, self._kill_rest)

    def _kill_rest(self) -> None:
        if self.gateway.alive(self.gateway.controller):
            self.judge.dies("the guardian was killed")
            self.gateway.signal(self.gateway.controller, signal.SIGKILL)
        self._after(70)

    def _kill_both(self, _: Hazard) -> None:
        if self.gateway.alive(self.gateway.service):
            self.judge.dies("both were killed")
            self.gateway.signal(self.gateway.service, signal.SIGKILL)
            self.gateway.signal(self.gateway.controller, signal.SIGKILL)
            if not self.script.systemd:
                self.judge.gone()
            else:
                self.judge.meant(KILLED_S + ESTOP_S, "both were killed")
                self._after(70)

    def _freeze(self, _: Hazard) -> None:
        if self.gateway.alive(self.gateway.controller):
            self.judge.frozen = True
            self.judge.dies("the controller was frozen")
            self.judge.meant(FROZEN_S, "the controller hangs")
            self.gateway.signal(self.gateway.controller, signal.SIGSTOP)

    def _power(self, hazard: Hazard) -> None:
        self._wanted = False
        self.judge.dies("the power was cut")
        self.judge.gone()
        self.gateway.cut_power(hazard.detail)

    def _estop(self, _: Hazard) -> None:
        self.judge.helped()
        self.judge.meant(ESTOP_S, "estop")
        self.gateway.estop()

    def _edit(self, hazard: Hazard) -> None:
        now, at, usual = self.gateway.entries, hazard.bay, entries(self.script)
        if hazard.detail == "remove":
            now = [entry for entry in now if entry.port != at]
        elif hazard.detail == "restore":
            now = usual
        elif hazard.detail == "rename":
            now = [replace(one, name=f"{one.name}b") if one.port == at else one for one in now]
        elif hazard.detail == "rewire":  # every bay has another bay's name
            now = [replace(one, name=f"bay-{(one.port + 1) % 3 + 1}") for one in now]
        elif hazard.detail == "swap":
            other = {at: (at + 1) % 3, (at + 1) % 3: at}
            now = [replace(one, port=other.get(one.port, one.port)) for one in now]
        elif hazard.detail == "nodes":
            other = {at: (at + 1) % 3, (at + 1) % 3: at}
            now = [replace(one, node=other.get(one.node, one.node)) for one in now]
        elif hazard.detail == "inherit":  # it has a new name, and the next one has its old name
            names = {at: "bay-new", (at + 1) % 3: f"bay-{at + 1}"}
            now = [replace(one, name=names.get(one.port, one.name)) for one in now]
        self.gateway.entries = now or usual
        self.gateway.write_station()

    def _ask(self, hazard: Hazard) -> None:
        names = [entry.name for entry in self.judge.life if hazard.bay in (-1, entry.port)]
        asked = self.gateway.ask({"verb": hazard.detail, "bays": names}, self.judge.answered)
        self.judge.asked(asked, names)

    # --- lines, devices -----------------------------------------------------------------------------------------------

    def _fault(self, hazard: Hazard) -> None:
        for rig in self._rigs(hazard):
            rig.inject(lambda rig: FAULTS[hazard.detail].happen(rig, hazard.value))
            rig.frozen = rig.frozen or hazard.detail == "bmu_frozen"

    def _comes(self, hazard: Hazard) -> None:
        """detail: FIELD; for 2.75 s of every 3 s the BMU reports that much more."""
        for rig in self._rigs(hazard):
            rig.bay.falsify[hazard.detail] = partial(self._more, hazard.value or 0.0)
            rig.apart_v = (hazard.value or 0.0) if hazard.detail == "voltage_v" else 0.0
            rig.frozen = False  # not in all of its words

    def _more(self, more: float, true: float) -> float:
        return true + (more if self.time.now_s % 3.0 < 2.75 else 0.0)

    def _loose(self, hazard: Hazard) -> None:
        """A plug with contact for `value` s, then without for as long."""
        for rig in self._rigs(hazard):
            rig.bay.connected = not rig.bay.connected
            rig.bmu.port.faults.mute = not rig.bay.connected
        self.time.call_later(hazard.value or 1.0, self._loose, hazard)

    def _heal(self, hazard: Hazard) -> None:
        for rig in self._rigs(hazard):
            rig.inject(lambda rig: FAULTS["heal"].happen(rig, None))
            rig.bmu.port.faults.delay_s = ANSWER_S
            rig.wire.late_s = None
            rig.frozen = False

    def _lie(self, hazard: Hazard) -> None:
        name, every = hazard.detail.split(":")
        lie = Lie(int(hazard.value or 0), max(1, int(every)), inf if int(every) else 1)
        for rig in self._rigs(hazard):
            rig.wire.liars[Kind[name]] = lie

    def _bmu(self, hazard: Hazard) -> None:
        """detail: FIELD:is|frozen|more:EVERY (0: once)."""
        name, how, every = hazard.detail.split(":")
        for rig in self._rigs(hazard):
            rig.catch_up()
            lie = Lie(0, max(1, int(every)), inf if int(every) else 1)
            value = hazard.value or 0.0
            told = int(value) if name == "status" else value  # a word of bits
            rig.bay.falsify[name] = _liar(lie, how, getattr(rig.bay.readout(), name), told)
            rig.steady = int(every) == 1
            rig.frozen = False  # not in all of its words

    def _slow(self, hazard: Hazard) -> None:
        """detail: CALL:port|diskNAME|directory|chip|stderr:LASTS[:ERRNO]; value: seconds, FOR_EVER."""
        call, place, lasts, *error = hazard.detail.split(":")
        delay_s = inf if hazard.value == FOR_EVER else hazard.value or 0.0
        on_disk = f"{JOURNAL}/{place[4:]}" if place[4:] else JOURNAL
        places = {"port": port_name(hazard.bay), "directory": JOURNAL, "chip": CHIP, "stderr": "stderr"}
        where = places.get(place, on_disk)
        until_s = self.time.now_s + float(lasts)
        number = getattr(errno, error[0]) if error else 0
        trouble = Trouble(call, where, until_s, delay_s, number, exact=place == "directory")
        self.gateway.kernel.calls.troubles.append(trouble)

    def _stderr(self, hazard: Hazard) -> None:
        stream = self.gateway.kernel.output[STDERR]
        stream.stopped = bool(hazard.value)
        stream.news.wake()

    def _settings(self, hazard: Hazard) -> None:
        for rig in self._rigs(hazard):
            rig.tty.taken_over(int(hazard.value or 0))

    def _getty(self, hazard: Hazard) -> None:
        for rig in self._rigs(hazard):
            rig.tty.taken_over(int(hazard.value or 0), line_by_line=True)

    def _lock(self, hazard: Hazard) -> None:
        for rig in self._rigs(hazard):
            rig.wire.lock()

    def _unlock(self, hazard: Hazard) -> None:
        for rig in self._rigs(hazard):
            rig.wire.unlock()

    def _steal(self, hazard: Hazard) -> None:
        for rig in self._rigs(hazard):
            rig.tty.stolen = True

    def _unsteal(self, hazard: Hazard) -> None:
        for rig in self._rigs(hazard):
            rig.tty.stolen = False

    def _write(self, hazard: Hazard) -> None:
        """Another program looks for a modem."""
        for rig in self._rigs(hazard):
            rig.tty.listener(b"AT+GCAP\r")

    def _stty(self, hazard: Hazard) -> None:
        """detail: a word of `stty`, or "suspended": Ctrl-S was typed there (TCOOFF)."""
        for rig in self._rigs(hazard):
            if hazard.detail == "suspended":
                rig.tty.flow(goes=False)
            else:
                rig.tty.altered(hazard.detail)

    def _program(self, hazard: Hazard) -> None:
        """detail: FRAME+FRAME:EVERY_S:TIMES."""
        names, every_s, times = hazard.detail.split(":")
        data = program.frames(names)
        for rig in self._rigs(hazard):
            rig.catch_up(force=True)
            self._repeat(int(times), float(every_s), partial(rig.wire.hears_stranger, data))

    def _late(self, hazard: Hazard) -> None:
        """Its answers come late, within the deadline, in `value` pieces."""
        for rig in self._rigs(hazard):
            rig.wire.late_s, rig.wire.pieces = LATE_S, int(hazard.value or 1)

    # --- contactors, disk, clock --------------------------------------------------------------------------------------

    def _contactor(self, hazard: Hazard) -> None:
        """detail: slow (by `value` s), stuck, well."""
        for rig in self._rigs(hazard):
            if rig.breaker is not None:
                rig.breaker.slow_s = (hazard.value or 0.0) if hazard.detail == "slow" else 0.0
                rig.breaker.stuck = hazard.detail == "stuck"

    def _chip(self, hazard: Hazard) -> None:
        """detail: gone, taken (by another program), back. Without the chip nothing drives the lines."""
        chip = self.gateway.kernel.chips[CHIP]
        chip.present = hazard.detail != "gone"
        for output in chip.outputs.values() if hazard.detail == "gone" else ():
            output.drive(False)

    def _kept(self, hazard: Hazard) -> None:
        """detail: new content of the file of persisted state."""
        self.gateway.disk.damage(f"{JOURNAL}/persisted.json", hazard.detail)
        self.judge.forgotten()

    def _clock(self, hazard: Hazard) -> None:
        self.gateway.kernel.clock_off_s += hazard.value or 0.0

    # --- the bus ------------------------------------------------------------------------------------------------------

    def _tool(self, hazard: Hazard) -> None:
        """Permitted actions of a CANopen tool or another device on the bus."""
        node, bus = FIRST_NODE + hazard.bay, self.gateway.bus
        {
            "master": lambda: self._repeat(400, 0.013, lambda: bus.send(0x600 + node, _read(0x6000))),
            "reads all": lambda: self._repeat(40, 0.03, lambda: bus.send(0x600 + node, _read(0x1018))),
            "abort": lambda: self._repeat(99, 0.03, lambda: bus.send(0x600 + node, REFUSED)),
            "fd": lambda: bus.subscribe(0x600 + node, self, self._answer_fd),
            "heartbeat": lambda: bus.send(0x600 + node, b"\x2b\x17\x10\x00\x88\x13\x00\x00"),
            "flood": lambda: self._repeat(400, 0.002, lambda: bus.send(0x123, bytes(8))),
            "EMCY without error": lambda: bus.send(0x080 + node, bytes(8)),
            "extended": lambda: self._repeat(99, 0.03, lambda: bus.raw(_extended(0x580 + node))),
            "remote": lambda: self._repeat(99, 0.03, lambda: bus.send_remote(0x580 + node)),
            "SYNC": lambda: self._repeat(400, 0.01, lambda: bus.send(0x080, b"")),
            "LSS": lambda: self._repeat(40, 0.1, lambda: bus.send(0x7E5, b"\x4c" + bytes(7))),
            "other nodes": lambda: self._repeat(80, 0.05, lambda: bus.send(0x700 + 0x44, b"\x05")),
            "reads in segments": lambda: SecondMaster(self.time, bus, node).keep_reading(period_s=0.03),
            "reads in blocks": lambda: SecondMaster(self.time, bus, node).keep_reading(period_s=0.03, blocks=True),
        }[hazard.detail]()

    def _bus(self, hazard: Hazard) -> None:
        """Forbidden actions."""
        node, bus = FIRST_NODE + hazard.bay, self.gateway.bus
        {
            "node": lambda: self._repeat(20, 0.2, lambda: bus.send(0x700 + node, b"\x05")),
            "forged": lambda: bus.subscribe(0x600 + node, self, self._forge),
            "odd answers": lambda: bus.subscribe(0x600 + node, self, self._answer_oddly),
            "stopped": lambda: bus.send(0x000, bytes((2, node))),
            "reset": lambda: bus.send(0x000, bytes((0x81, 0))),
            "EMCY": lambda: bus.send(0x080 + node, b"\x00\x50\x01" + bytes(5)),
            "short EMCY": lambda: bus.send(0x080 + node, b"\x00\x50"),
        }[hazard.detail]()

    def _answer_fd(self, cob_id: int, data: bytes) -> None:
        """A frame of a different bus that looks like an answer: 60.0 °C."""
        if data[:3] == b"\x40\x04\x60":
            self.gateway.bus.raw(_fd(cob_id - 0x80))

    def _forge(self, cob_id: int, data: bytes) -> None:
        """Somebody answers in the BMU's name, faster: 20.0 °C."""
        if data[:3] == b"\x40\x04\x60":
            self.gateway.bus.send(cob_id - 0x80, b"\x43\x04\x60\x00\xc8\x00\x00\x00")

    def _answer_oddly(self, cob_id: int, data: bytes) -> None:
        """Another node answers too, starting a segmented transfer, or with a wrong toggle bit."""
        if data[:1] == b"\x40":
            self.gateway.bus.send(cob_id - 0x80, b"\x51" + data[1:4] + b"\x04\x00\x00\x00")

    def _repeat(self, times: int, every_s: float, act: Callable[[], object]) -> None:
        act()
        if times > 1:
            self.time.call_later(every_s, self._repeat, times - 1, every_s, act)


def _liar(lie: Lie, how: str, frozen: Any, value: float) -> Callable[[Any], Any]:
    """A value as the BMU reports it: another value, the present one for ever, or that much more; None stays None.

    Or the previous one (`previous`), or alternately this one and 100 minus it (`turns`).
    """
    said: list[Any] = [frozen]

    def told(true: Any) -> Any:
        before, said[0] = said[0], true
        if not lie.is_told():
            return 100.0 - value if how == "turns" else true
        if how == "previous":
            return before
        if how == "more":
            return true if true is None else true + value
        return frozen if how == "frozen" else value

    return told


def _read(index: int) -> bytes:
    return b"\x40" + index.to_bytes(2, "little") + bytes(5)


def _extended(cob_id: int) -> can.Message:
    """A 29-bit frame with an id ending like the BMU's: 60.0 °C."""
    data = b"\x43\x04\x60\x00\x58\x02\x00\x00"
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=True)


def _fd(cob_id: int) -> can.Message:
    data = b"\x43\x04\x60\x00\x58\x02\x00\x00"  # looks like 60.0 °C
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, is_fd=True)


#: Somebody tries to write a measurement; the BMU refuses.
REFUSED = b"\x2b\x00\x60\x00\x01\x00\x00\x00"


def entries(script: Script) -> list[Entry]:
    """The intended station file."""
    policies = ["small.yaml" if bay.small else "li-ion-48v" for bay in script.bays]
    return [
        Entry(f"bay-{number + 1}", number, number, policy=policy, control=bay.control, contactor=bay.contactor)
        for number, (bay, policy) in enumerate(zip(script.bays, policies, strict=True))
    ]


def _nature(bay: Any, number: int) -> Nature:
    pack = Pack(cells=bay.cells)
    pack.set_soc(bay.soc_pct)
    pack.temperature_c = pack.ambient_c = bay.temperature_c
    control = ControlMode[bay.control.upper()]
    return Nature(
        pack, control, line=bay.line, seed=number + 1, running=bay.running, contactor=bay.contactor
    )  # fmt: skip


def live(script: Script) -> Lived:
    """Play it to its end."""
    return Player(script).run()
