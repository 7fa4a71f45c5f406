"""One scene for every way in which a row of the fault table becomes true, and false again."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from orchestrator.config.policy import Band, Policy, Table
from orchestrator.keys import Range
from orchestrator.model import (
    Action,
    BatteryStatus,
    ChargeMode,
    Connection,
    ControlMode,
    ErrorBit,
    Operation,
    Precharge,
    Request,
    State,
)
from tests.core.bays import POLICY, charging, full, idle, pulse, qualifying, running_at_the_start, suspended
from tests.core.said import cause
from tests.core.world import TICK_S, World, bay

Act = Callable[[World], object]
S = State

# --- worlds for single rows -------------------------------------------------------------------------------------------


def with_policy(policy: Policy) -> Callable[[], World]:
    return lambda: World(bay(policy)).charging()


def paused_when_warm() -> World:
    rows = (Band(from_=0, to=25), Band(from_=25, to=45, max_a=0.0))
    table = Table(hysteresis=2.0, rows=rows)
    return World(bay(replace(POLICY, current=replace(POLICY.current, temperature_c=table)))).charging()


def too_strong() -> World:
    """A charger whose lowest step is above what the policy allows, in precharge and for a warm pack."""
    assert POLICY.precharge is not None
    table = Table(rows=(Band(from_=0, to=25), Band(from_=25, to=45, max_a=1.9)))
    current = replace(POLICY.current, temperature_c=table)
    world = World(bay(replace(POLICY, current=current, precharge=replace(POLICY.precharge, max_a=1.9))))
    world.until(S.QUALIFYING)
    return world


def finish(max_hours: float = 12.0, max_ah: float = 44.0) -> Policy:
    return replace(POLICY, finish=replace(POLICY.finish, max_hours=max_hours, max_ah=max_ah))


def warm(celsius: float) -> Callable[[], World]:
    return lambda: World(temperature_c=celsius).charging()


def with_soc(percent: float) -> Callable[[], World]:
    return lambda: World(soc_pct=percent).charging()


def nearly_at_90() -> World:
    """With a pack that takes so little by now that nothing flows above the lower step."""
    world = World(soc_pct=88.0)
    world.amps = 7.0
    return world.charging()


def hot() -> World:
    """With a pack that may reach 56 °C, so that the trip comes before the pause."""
    policy = replace(POLICY, pack=replace(POLICY.pack, temperature_c=Range(0, 56)))
    the_bay = bay(policy)
    return World(
        replace(the_bay, limits=replace(the_bay.limits, temperature_c=Range(0, 60))), temperature_c=52
    ).charging()


def long_charging() -> World:
    world = charging()
    world.run(190, dt_s=1.0)
    return world


def short_continuous() -> World:
    assert POLICY.precharge is not None
    rule = replace(POLICY.precharge, continuous=replace(POLICY.precharge.continuous, max_min=4))
    return World(bay(replace(POLICY, precharge=rule)), voltage_v=36.0).charging(S.PRECHARGE_CONTINUOUS)


def tapered() -> World:
    """The pack's current has fallen off, as it does before a charger ends."""
    world = charging()
    world.amps = 3.5
    world.run(6)
    return world


def ordered_to_run() -> World:
    world = World()
    world.deaf.add(Action.RUN)
    world.until(S.CHARGING)
    while world.decision.command is None or world.decision.command.action is not Action.RUN:
        world.tick()
    return world


def with_tpdos() -> World:
    the_bay = bay()
    world = World(replace(the_bay, battery=replace(the_bay.battery, tpdo_s=0.1)))
    world.battery_link = replace(world.battery_link, heartbeat_s=0.5, heartbeat_t_s=1e9, nmt_state=5)
    return world.charging()


def beating() -> World:
    world = World()
    world.battery_link = replace(world.battery_link, heartbeat_s=0.5, heartbeat_t_s=1e9)
    return world.charging()


# --- what goes wrong, and how it ends ---------------------------------------------------------------------------------


def shows(**values: object) -> Act:
    return lambda world: world.shows.update(values)


def value(**values: float) -> Act:
    return lambda world: world.values.update(values)


def world_without(*names: str) -> Act:
    return lambda world: world.values.update(dict.fromkeys(names))


def bmu(**changes: object) -> Act:
    def act(world: World) -> None:
        world.battery_link = replace(world.battery_link, **changes)  # type: ignore[arg-type]  # its fields by name

    return act


def charger(**changes: object) -> Act:
    def act(world: World) -> None:
        world.charger_link = replace(world.charger_link, **changes)  # type: ignore[arg-type]  # its fields by name

    return act


def world_has(**changes: object) -> Act:
    def act(world: World) -> None:
        for name, new in changes.items():
            setattr(world, name, new)

    return act


def error_frame(bits: ErrorBit) -> Act:
    return lambda world: charger(error_bits=int(bits), error_t_s=world.now_s + TICK_S)(world)


def deaf(action: Action, **values: float) -> Act:
    def act(world: World) -> None:
        world.deaf.add(action)
        world.values.update(values)

    return act


def hears(world: World) -> None:
    world.deaf.clear()


def shows_truth(world: World) -> None:
    world.shows.clear()


def nothing(world: World) -> None:
    pass


def frozen(*names: str) -> Act:
    return lambda world: world.frozen.update(names)


def thawed(world: World) -> None:
    world.frozen.clear()


def still(**moved: float) -> Act:
    """The charger keeps reporting its present values, whatever moves."""

    def act(world: World) -> None:
        if world.reading is not None:
            world.shows |= {"voltage_v": world.reading.voltage_v, "current_a": world.reading.current_a}
        world.values.update(moved)

    return act


def measures_again(world: World) -> None:
    world.shows.clear()
    AS_BEFORE(world)


def waits(seconds: float) -> Act:
    return lambda world: world.run(seconds, dt_s=4.0)


def returns_as_another(world: World) -> None:
    """The BMU falls silent, and one that answers in its place has another SOC; the charger saw none of it."""
    world.battery_answers = False
    world.run(5)
    world.arrive(soc_pct=80.0)


def waiting() -> World:
    """Qualified while another bay begins its charge."""
    world = World()
    world.ours = {"waits": cause("bay-2 begins a charge")}
    world.until(S.QUALIFYING)
    world.run(60)
    return world


def goes_on(world: World) -> None:
    world.ours = {}
    measures_again(world)


def swapped() -> World:
    """The charger has just begun, and its bay's BMU sees nothing of it."""
    world = World()
    world.shunt = 0.0
    world.until(S.CHARGING)
    while not world.charger.running:
        world.tick()
    return world


def reverts(world: World) -> None:
    """The charger confirms the commanded step and twice reverts from it; the third time is still to come."""
    for shown in (0, 4, 0, 4):
        world.shows["current_step"] = shown
        world.tick()
    world.shows["current_step"] = 0


def comes_back_at_once(world: World) -> None:
    world.leave()
    world.run(5)
    world.arrive()


def line_found(world: World) -> None:
    charger(taken_over=cause("115200 baud"), taken_over_t_s=world.now_s + TICK_S)(world)


def starts_on_a_line_of_its_own(world: World) -> None:
    charger(taken_over_t_s=None)(world)
    world.ask(Request.START)


def somebody_else(what: str) -> Act:
    return lambda world: bmu(**{what: cause("by another master"), f"{what}_t_s": world.now_s + TICK_S})(world)


def falls_with_odd_figures(world: World) -> None:
    value(remaining_ah=10.0, available_wh=100.0, soc_pct=48.0)(world)
    world.run(899.75, dt_s=0.25)


def starts_by_itself(world: World) -> None:
    world.charger.resting, world.charger.run = False, True


def stops_by_itself(world: World) -> None:
    world.charger.run = False


def stopped_in_vain(world: World) -> None:
    world.deaf.add(Action.STOP)
    world.ask(Request.STOP)


@dataclass(frozen=True)
class Scene:
    """From a healthy bay to one fault, and back."""

    fault: str
    spoil: Act
    heal: Act
    evidence: tuple[str, ...]  #: required parts of the fault's text
    then: State  #: where the bay rests afterwards, or continues
    after_s: float = TICK_S  #: from the spoil to the fault; one tick earlier there is none
    begin: Callable[[], World] = charging
    anywhere: bool = True  #: it can occur like this in every state in which current flows
    lapse: bool = True  #: if its cause ends one tick earlier, it is not raised

    @property
    def name(self) -> str:
        return f"{self.fault}-{self.evidence[0]}".replace("°", "").replace("…", "..").replace(" ", "_")


ILLEGAL = "charge mode 9 (documented: 1 … 8)"
BELOW_V = POLICY.source.at("precharge.below_v")
PACK_V, SOH = POLICY.source.at("pack.voltage_v"), POLICY.source.at("pack.soh_min_pct")
BIT = {bit: float(1 << bit) for bit in BatteryStatus}
NO_PRECHARGE = replace(POLICY, precharge=None)
AS_BEFORE = value(temperature_c=20.0, voltage_v=48.0, status=0.0, soc_pct=50.0, soh_pct=100.0)
NO_FIGURES = world_without("remaining_ah", "available_wh", "time_to_full_min")
QUIET_LINE = charger(error_bits=0, error_t_s=None)


SCENES: tuple[Scene, ...] = (
    Scene("reverse_polarity", shows(connection=Connection.REVERSED), shows_truth, ("connection 0",), S.TRIPPED),
    Scene("reverse_polarity", shows(charge_mode=ChargeMode.REVERSED), shows_truth, ("mode 6",), S.TRIPPED),
    Scene("polarity_contradicts", shows(charge_mode=ChargeMode.REVERSED), shows_truth, ("mode 6", "connection 1"),
          S.TRIPPED, 0.5, anywhere=False),
    Scene("error_stop", shows(charge_mode=ChargeMode.ERROR_STOP), shows_truth, ("mode 8",), S.TRIPPED),
    Scene("system_stop", shows(charge_mode=ChargeMode.SYSTEM_STOP), shows_truth, ("mode 7",), S.HELD),
    Scene("illegal_value", shows(charge_mode=None, illegal=(cause(ILLEGAL),)), shows_truth, (ILLEGAL,), S.SUSPENDED,
          0.5),
    Scene("mode_taken_over", shows(control_mode=ControlMode.AUTOMATIC), shows_truth,
          ("automatic mode", "says manual"), S.HELD, 0.5),
    Scene("rejected_frame", error_frame(ErrorBit.COMMAND), QUIET_LINE, ("0x1F", "wrong command"), S.TRIPPED),
    Scene("rejected_frame", error_frame(ErrorBit.ORDER), QUIET_LINE, ("0x1F", "wrong order"), S.TRIPPED),
    Scene("line_taken_over", line_found, charger(taken_over_t_s=None), ("/dev/ttyX to 115200 baud",), S.SUSPENDED),
    Scene("line_changed", line_found, starts_on_a_line_of_its_own, ("/dev/ttyX to 115200 baud",), S.SUSPENDED,
          begin=suspended, anywhere=False),
    Scene("port_locked", charger(locked_by=cause("getty (process 812)")), charger(locked_by=None),
          ("/dev/ttyX: getty (process 812)", "in spite of it"), S.SUSPENDED),
    Scene("noisy_line", charger(bad_pct=5.1), charger(bad_pct=5.0), ("5 % of the last minute",), S.CHARGING),
    Scene("charger_silent", world_has(charger_answers=False), world_has(charger_answers=True),
          ("/dev/ttyX: no answer",), S.UNCONTROLLABLE, 1.25),
    Scene("charger_silent", world_has(port_hangs=True), world_has(port_hangs=False),
          ("/dev/ttyX has sent no status for 1.5 s",), S.UNCONTROLLABLE, 1.75),
    Scene("charger_silent", charger(online=False, problem=cause("/dev/ttyX: Input/output error")),
          charger(online=True, problem=None), ("/dev/ttyX: Input/output error",), S.OFFLINE),
    Scene("charger_silent", charger(online=False, misses=2), charger(online=True), ("/dev/ttyX has not answered",),
          S.OFFLINE),
    Scene("found_running", nothing, nothing, ("found running",), S.HELD, begin=running_at_the_start, anywhere=False),
    Scene("rogue_run", starts_by_itself, nothing, ("2.00 A",), S.TRIPPED, begin=idle, anywhere=False),
    Scene("rogue_run", world_has(leak_a=0.51), world_has(leak_a=0.5), ("0.51 A",), S.UNCONTROLLABLE, begin=full,
          anywhere=False),
    Scene("current_without_order", world_has(pack_amps=1.01), world_has(pack_amps=None),
          ("1.01 A flow", "the charger says 0.00 A", "or the BMU's current is wrong"), S.UNCONTROLLABLE, 2.25,
          begin=idle, anywhere=False),
    Scene("will_not_stop", stopped_in_vain, hears, ("14.00 A",), S.UNCONTROLLABLE, 3.25, anywhere=False),
    Scene("contactor_lost", world_has(connected=False, contactor_problem=cause("/dev/gpiochip0: gone")),
          world_has(connected=True, contactor_problem=None), ("/dev/gpiochip0: gone",), S.SUSPENDED),
    Scene("will_not_start", nothing, hears, ("told 'run' for 5.0 s",), S.SUSPENDED, 5.0, begin=ordered_to_run,
          anywhere=False, lapse=False),
    Scene("stopped_by_itself", stops_by_itself, nothing, ("stopped though",), S.HELD, 0.5, lapse=False),
    Scene("setting_not_obeyed", deaf(Action.SET_LIMIT, temperature_c=16.0, soc_pct=90.0), hears,
          ("told 'step 3' for 5.0 s",), S.TRIPPED, 5.25, begin=nearly_at_90, anywhere=False, lapse=False),
    Scene("setting_not_obeyed", shows(charge_mode=ChargeMode.PRECHARGE), shows_truth, ("told 'mode 4'",), S.TRIPPED,
          5.25, anywhere=False, lapse=False),
    Scene("setting_not_obeyed", shows(precharge=Precharge.OFF), shows_truth, ("told 'precharge 1'",), S.TRIPPED, 5.25,
          begin=pulse, anywhere=False, lapse=False),
    Scene("limit_reverted", reverts, shows_truth, ("went back by itself 3 times",), S.TRIPPED, anywhere=False),
    Scene("above_step", deaf(Action.SET_LIMIT, soc_pct=90.0), hears, ("14.00 A", "9.10 A", "8 A were commanded"),
          S.TRIPPED, 2.5, begin=with_soc(88.0), anywhere=False),
    Scene("over_current", world_has(amps=15.71), world_has(amps=None), ("15.71 A", "15.70 A"), S.TRIPPED, 0.5),
    Scene("early_full", shows(charge_mode=ChargeMode.FULL, operation=Operation.STOPPED), shows_truth,
          ("mode 5", "only 50 %"), S.HELD, 0.5, begin=tapered, anywhere=False),
    Scene("open_circuit", world_has(amps=0.09), world_has(amps=None), ("delivered nothing for 10 s",), S.SUSPENDED,
          10.25, anywhere=False),
    Scene("no_battery", shows(charge_mode=ChargeMode.BATTERY_SEARCH), shows_truth, ("looking for a battery for 1 min",),
          S.SUSPENDED, 60.25, anywhere=False),
    Scene("loose_plug", comes_back_at_once, nothing, ("left in mid-charge", "back at once"), S.SUSPENDED,
          anywhere=False),
    Scene("wakes_too_long", shows(charge_mode=ChargeMode.BATTERY_RECOVERY), shows_truth, ("for 30 min",), S.TRIPPED,
          1800.25, anywhere=False),
    Scene("over_voltage", world_has(volts=55.21), world_has(volts=None), ("55.21 V at the charger", "55.2 V"),
          S.TRIPPED),
    Scene("over_voltage", value(voltage_v=55.21), AS_BEFORE, ("55.21 V at the charger",), S.TRIPPED),
    Scene("over_voltage", lambda world: (value(voltage_v=55.21)(world), world_has(volts=48.0)(world)),
          lambda world: (AS_BEFORE(world), world_has(volts=None)(world)), ("55.21 V at the pack", "55.2 V"), S.TRIPPED),
    Scene("volts_disagree", world_has(volts=49.01), world_has(volts=None), ("49.01 V", "48.00 V"), S.TRIPPED, 3.25,
          anywhere=False),
    Scene("pairing_not_proved", nothing, world_has(shunt=1.0), ("begun with 14.00 A", "node 0x10", "0.00 A of it"),
          S.HELD, 2.75, begin=swapped, anywhere=False),
    Scene("not_paired", world_has(volts=46.99), world_has(volts=None), ("46.99 V", "48.00 V"), S.SUSPENDED, 1.25,
          begin=qualifying, anywhere=False),
    Scene("amps_disagree", world_has(shunt=12.59 / 14), world_has(shunt=1.0), ("14.00 A", "12.59 A"), S.TRIPPED,
          5.25, anywhere=False),
    Scene("charger_frozen", still(voltage_v=48.21), measures_again,
          ("48.00 V and 14.00 A for 63 s", "0.21 V"), S.UNCONTROLLABLE, 63.0, anywhere=False),
    Scene("charger_frozen_at_rest", still(voltage_v=48.21), goes_on, ("48.00 V for 6", " s at rest", "0.21 V"),
          S.SUSPENDED, 3.25, begin=waiting, anywhere=False),
    Scene("bmu_frozen", world_has(counts=False, volts=48.21), world_has(counts=True, volts=None),
          ("every word for 63 s", "0.21 V"), S.SUSPENDED, 63.0, anywhere=False),
    Scene("pack_collapsed", value(voltage_v=38.21), AS_BEFORE, ("sunk to 38.21 V", "below 39 V", BELOW_V), S.TRIPPED,
          anywhere=False),
    Scene("pack_collapsed", value(voltage_v=45.59), AS_BEFORE, ("from 48.00 to 45.59 V", "14.00 A"), S.TRIPPED,
          anywhere=False),
    Scene("back_feed", world_has(pack_amps=-0.51), world_has(pack_amps=None), ("0.51 A",), S.TRIPPED, 2.25),
    Scene("bmu_silent", world_has(battery_answers=False), world_has(battery_answers=True), ("node 0x10",),
          S.OFFLINE, 1.5),
    Scene("bmu_silent", bmu(online=False, problem=cause("two nodes share the id")), bmu(online=True, problem=None),
          ("two nodes share the id",), S.OFFLINE),
    Scene("stale_reading", frozen("voltage_v", "current_a"), thawed, ("voltage, current",), S.SUSPENDED, 1.75),
    Scene("stale_reading", frozen("status"), thawed, ("status",), S.SUSPENDED, 1.75),
    Scene("stale_reading", frozen("temperature_c"), thawed, ("temperature",), S.SUSPENDED, 1.75),
    Scene("stale_reading", frozen("soc_pct"), thawed, ("SOC",), S.SUSPENDED, 3.25),
    Scene("stale_reading", frozen("soh_pct"), thawed, ("SOH",), S.SUSPENDED, 3.25),
    Scene("sdo_refused", bmu(abort=cause("0x6004: no such object"), abort_code=0x06020000), bmu(abort=None,
          abort_code=0),
          ("0x6004: no such object",), S.TRIPPED),
    Scene("sdo_aborted", bmu(abort=cause("0x6004: device state"), abort_code=0x08000022), bmu(abort=None, abort_code=0),
          ("0x6004: device state",), S.SUSPENDED, 0.75),
    Scene("heartbeat_lost", lambda world: bmu(heartbeat_t_s=world.now_s)(world), bmu(heartbeat_t_s=1e9),
          ("no heartbeat", "2.5 s"), S.SUSPENDED, 2.5, begin=beating, anywhere=False),
    Scene("not_operational", bmu(nmt_state=0x7F), bmu(nmt_state=5), ("pre-operational",), S.SUSPENDED, 4.25,
          begin=with_tpdos, anywhere=False),
    Scene("bmu_rebooted", World.boot, nothing, ("booted while charging",), S.OFFLINE),
    Scene("status_trip", value(status=BIT[BatteryStatus.OVER_VOLTAGE]), AS_BEFORE, ("over voltage", "0x0001"),
          S.TRIPPED),
    Scene("status_trip", value(status=BIT[BatteryStatus.CHARGE_OVER_CURRENT]), AS_BEFORE,
          ("charge over current", "0x0004"), S.TRIPPED),
    Scene("status_trip", value(status=BIT[BatteryStatus.HIGH_TEMPERATURE]), AS_BEFORE, ("high temperature",),
          S.TRIPPED),
    Scene("status_trip", value(status=BIT[BatteryStatus.BMU_ERROR]), AS_BEFORE, ("bmu error", "0x0040"), S.TRIPPED),
    Scene("status_limit", value(status=BIT[BatteryStatus.LOW_TEMPERATURE]), AS_BEFORE, ("low temperature",),
          S.CHARGING),
    Scene("status_limit", value(status=BIT[BatteryStatus.DISCHARGE_OVER_CURRENT]), AS_BEFORE,
          ("discharge over current", "0x0008"), S.CHARGING),
    Scene("emergency", bmu(emergency=cause("EMCY 0x4210: temperature")), bmu(emergency=None), ("EMCY 0x4210",), S.HELD),
    Scene("hot_trip", value(temperature_c=55.0), value(temperature_c=52.0), ("55.0 °C", "55 °C"), S.TRIPPED, begin=hot,
          anywhere=False),
    Scene("over_temperature", value(temperature_c=45.0), value(temperature_c=39.9), ("45.0 °C", "below 40 °C"),
          S.SUSPENDED, begin=warm(42.0), anywhere=False),
    Scene("under_temperature", value(temperature_c=-0.1), value(temperature_c=3.0), ("-0.1 °C", "at 3 °C"),
          S.SUSPENDED, begin=warm(2.0), anywhere=False),
    Scene("runaway", value(temperature_c=23.3), nothing, ("K/min, more than 1 K/min",), S.TRIPPED, 1.25,
          begin=long_charging, anywhere=False, lapse=False),
    Scene("temperature_invalid", bmu(implausible={"temperature_c": cause("temperature 3276.7 °C")}),
          bmu(implausible={}),
          ("3276.7 °C",), S.TRIPPED),
    Scene("temperature_invalid", value(temperature_c=25.1), nothing,
          ("from 20.0 to 25.1 °C in 0.25 s", "no pack warms or cools this fast"), S.TRIPPED),
    Scene("implausible", bmu(implausible={"soc_pct": cause("SOC 140 %"), "temperature_c": cause("x")}),
          bmu(implausible={}),
          ("SOC 140 %",), S.TRIPPED),
    Scene("implausible", bmu(implausible={"soc_pct": cause("SOC 141 %")}), bmu(implausible={}), ("SOC 141 %",),
          S.SUSPENDED),
    Scene("under_voltage", value(voltage_v=25.99), value(voltage_v=33.0), ("25.99 V", "26 V", PACK_V),
          S.PRECHARGE_PULSE, 1.25, begin=pulse, anywhere=False),
    Scene("needs_precharge", value(status=BIT[BatteryStatus.LOW_VOLTAGE]), AS_BEFORE, ("no precharge",), S.CHARGING,
          1.25, begin=with_policy(NO_PRECHARGE), anywhere=False),
    Scene("soh_low", value(soh_pct=59.0), AS_BEFORE, ("59 %", "60 %", SOH), S.CHARGING),
    Scene("soc_jump", value(soc_pct=56.0), waits(900), ("from 50 to 56 % in 0 s",), S.CHARGING, anywhere=False),
    Scene("soc_falls", value(soc_pct=48.0), AS_BEFORE, ("from 50 to 48 % in 15 min",), S.CHARGING, 900.0,
          anywhere=False),
    Scene("figures_disagree", value(remaining_ah=10.0, available_wh=100.0), NO_FIGURES,
          ("10.00 Ah and 100.0 Wh", "10.0 V", "48.00 V"), S.CHARGING, 300.25, anywhere=False),
    Scene("figures_disagree", value(remaining_ah=10.0, time_to_full_min=150.0), NO_FIGURES,
          ("full in 150 min", "35.0 Ah", "10.0 Ah"), S.CHARGING, 300.25, anywhere=False),
    Scene("soc_not_believed", falls_with_odd_figures, NO_FIGURES, ("fallen from 50 to 48 %", "10.00 Ah"), S.HELD, 0.5,
          anywhere=False, lapse=False),
    Scene("battery_exchanged", returns_as_another, nothing, ("from 50 to 80 % in 5 s",), S.HELD, anywhere=False),
    Scene("wrong_policy", value(voltage_v=45.0, soc_pct=51.0), AS_BEFORE,
          ("45.00 V at SOC 51 %", "13 NMC/NCA cells", "3.46 V a cell", "at least 3.50 V"), S.SUSPENDED, 1.25,
          begin=qualifying, anywhere=False),
    Scene("another_pack", value(voltage_v=45.65, soc_pct=55.0), AS_BEFORE, ("45.65 V at SOC 55 %", "at least 3.5"),
          S.HELD, 5.25, anywhere=False),
    Scene("current_paused", value(temperature_c=25.0), value(temperature_c=22.9), ("25.0 °C in 25 … 45", "no current"),
          S.SUSPENDED, begin=paused_when_warm, anywhere=False),
    Scene("no_step_allowed", value(temperature_c=25.0), value(temperature_c=22.9), ("allows 1.9 A", "is 2 A"),
          S.SUSPENDED, 1.25, begin=too_strong, anywhere=False),
    Scene("precharge_too_strong", value(voltage_v=33.0, soc_pct=2.0), AS_BEFORE, ("33.00 V", "1.9 A", "is 2 A"),
          S.SUSPENDED, 1.25, begin=too_strong, anywhere=False),
    Scene("other_master", somebody_else("other_master"), bmu(other_master_t_s=None), ("by another master",),
          S.CHARGING),
    Scene("heartbeat_set", somebody_else("heartbeat_set"), bmu(heartbeat_set_t_s=None), ("by another master",),
          S.CHARGING),
    Scene("precharge_no_rise", value(voltage_v=33.29), value(voltage_v=34.0), ("0.29 V in 5.0 min", "0.3 V"),
          S.TRIPPED, 299.0, begin=pulse, anywhere=False),
    Scene("precharge_too_long", nothing, nothing, ("4.0 min", "39 V"), S.TRIPPED, 240.0, begin=short_continuous,
          anywhere=False, lapse=False),
    Scene("time_limit", nothing, nothing, ("0.10 h",), S.TRIPPED, 359.25, begin=with_policy(finish(max_hours=0.1)),
          anywhere=False, lapse=False),
    Scene("ah_limit", nothing, nothing, ("0.35 Ah", "since SOC 50 %", "0.5 Ah"), S.TRIPPED, 90.0,
          begin=with_policy(finish(max_ah=0.5)), anywhere=False, lapse=False),
    Scene("internal", world_has(internal="KeyError('x') in step, line 9"), nothing, ("KeyError('x')", "line 9"),
          S.TRIPPED),
    Scene("late", world_has(ours={"late_s": 0.41}), world_has(ours={}), ("0.41 s late",), S.CHARGING),
    Scene("overrun", world_has(ours={"late_s": 1.01}), world_has(ours={}), ("for 1.0 s",), S.SUSPENDED),
    Scene("suspended", world_has(ours={"slept_s": 2.1}), world_has(ours={}), ("suspended for 2 s",), S.SUSPENDED),
    Scene("not_persisted", world_has(ours={"not_persisted": cause("kept.json: No space left")}), world_has(ours={}),
          ("No space left",),
          S.CHARGING),
    Scene("supply_failed", world_has(ours={"supply_problem": cause("KeyError('hall')")}),
          world_has(ours={}), ("KeyError('hall')",), S.CHARGING),
)  # fmt: skip
