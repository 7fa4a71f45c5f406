"""A scenario's devices as the service sees them: commands out, readings in, as coarse as on the wire.

One turn of the charger's line is one tick: the charger receives the command in the middle of it and reports at its end.
The BMU answers everything in every tick. Lost frames and delays belong in the service's tests, not in the workbench.
"""

from collections.abc import Callable

from orchestrator.config.scenario import Defect, SensorFault
from orchestrator.model import (
    Action,
    BatteryLink,
    BatteryReading,
    ChargerLink,
    ChargerReading,
    Command,
    Measurement,
    Request,
    Sent,
    Snapshot,
)
from orchestrator.sim.charger import Push, SimulatedCharger
from orchestrator.sim.pack import Pack
from orchestrator.workbench.simulate.plant import Plant

#: A turn of the charger's line (0.2 s) rounded up to a binary fraction, so that times add up exactly.
TICK_S = 0.25
#: After this long without a reading the BMU is silent, as in the service.
SILENT_S = 1.5


def _stop(charger: SimulatedCharger, _value: int) -> None:
    charger.rest(0)
    charger.push(Push.OPERATION, 0)


#: The effect of each command on the charger.
ORDERS: dict[Action, Callable[[SimulatedCharger, int], None]] = {
    Action.STOP: _stop,
    Action.RESUME: lambda charger, _: charger.rest(1),
    Action.SET_LIMIT: lambda charger, value: charger.push(Push.CURRENT_LIMIT, value),
    Action.SET_MODE: lambda charger, value: charger.push(Push.CHARGE_MODE, value),
    Action.SET_PRECHARGE: lambda charger, value: charger.push(Push.PRECHARGE, value),
    Action.RUN: lambda charger, _: charger.push(Push.OPERATION, 1),
}


class Devices:
    """The lines to one bay's charger and BMU."""

    def __init__(self) -> None:
        self.faults: tuple[SensorFault, ...] = ()  #: the active sensor faults
        self._link = ChargerLink(online=True)
        self._told: dict[str, Measurement] = {}

    def copy(self) -> "Devices":
        """An independent copy in the same state."""
        twin = Devices()
        twin.faults, twin._link, twin._told = self.faults, self._link, self._told
        return twin

    def obey(self, command: Command | None, charger: SimulatedCharger, now_s: float) -> None:
        """Deliver the command to the charger."""
        if command is None:
            return
        ORDERS[command.action](charger, command.value)
        stop_s = now_s if command.action is Action.STOP else self._link.stop_sent_s
        self._link = ChargerLink(online=True, sent=Sent(command, now_s), stop_sent_s=stop_s)

    def snapshot(self, plant: Plant, now_s: float, request: Request | None = None) -> Snapshot:
        """Everything known at the end of a tick."""
        if plant.pack is not None:
            self._told = {**self._told, **self._measured(plant.pack, now_s)}
        told = self._told
        spoke_s = max((told[name].t_s for name in ("voltage_v", "status") if name in told), default=-SILENT_S)
        return Snapshot(
            charger=_reading(plant.charger, now_s),
            charger_link=self._link,
            battery=BatteryReading(**told),
            battery_link=ONLINE if now_s - spoke_s < SILENT_S else OFFLINE,
            request=request,
        )

    def told_c(self, pack: Pack | None, now_s: float) -> float | None:
        """The temperature that the BMU reports at `now_s`; None if it reports none."""
        if pack is None:
            return None
        truth = {"temperature_c": pack.temperature_c}
        self._falsify(truth, now_s)
        told_c = truth.get("temperature_c")
        return None if told_c is None else round(told_c, DECIMALS["temperature_c"])

    def _measured(self, pack: Pack, now_s: float) -> dict[str, Measurement]:
        truth = {
            "voltage_v": pack.voltage_v,
            "current_a": pack.current_a,
            "status": float(pack.status()),
            "temperature_c": pack.temperature_c,
            "soc_pct": min(max(pack.soc * 100, 0.0), 100.0),
            "soh_pct": pack.soh_pct,
        }
        self._falsify(truth, now_s)
        return {name: Measurement(round(value, DECIMALS[name]), now_s) for name, value in truth.items()}

    def _falsify(self, truth: dict[str, float], now_s: float) -> None:
        for fault in self.faults:
            name: str = fault.sensor
            if name not in truth:
                continue
            match fault.defect:
                case Defect.SILENT:
                    del truth[name]
                case Defect.STUCK:
                    truth[name] = self._told[name].value if name in self._told else truth[name]
                case Defect.OFFSET:
                    truth[name] += fault.by
                case Defect.DRIFT:
                    truth[name] += fault.by * (now_s / 3600 - fault.from_h)


#: Digits after the decimal point, as in both object maps.
DECIMALS = {"voltage_v": 2, "current_a": 2, "status": 0, "temperature_c": 1, "soc_pct": 0, "soh_pct": 0}
ONLINE, OFFLINE = BatteryLink(online=True), BatteryLink()


def _reading(charger: SimulatedCharger, now_s: float) -> ChargerReading:
    return ChargerReading(
        t_s=now_s,
        voltage_v=round(charger.voltage_v, 2),
        current_a=round(charger.current_a, 2),
        control_mode=charger.control_mode,
        operation=charger.operation,
        current_step=charger.current_step,
        charge_mode=charger.charge_mode,
        precharge=charger.precharge,
        connection=charger.connection,
    )
