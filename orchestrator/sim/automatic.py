"""The stages that an emulated charger goes through by itself in automatic mode (rotary switch 2 … 5)."""

from orchestrator.model import ChargeMode, Precharge

#: How long the charger looks for a battery.
SEARCH_S = 2.0
#: Below these volts per cell it recovers the pack, precharges it, and charges a full one again.
RECOVERY_CELL_V, PRECHARGE_CELL_V, RECHARGE_CELL_V = 2.7, 3.0, 4.0


def stage_for(cell_v: float) -> tuple[ChargeMode, Precharge]:
    """Its stage for a pack it has found."""
    if cell_v < RECOVERY_CELL_V:
        return ChargeMode.BATTERY_RECOVERY, Precharge.PULSE
    if cell_v < PRECHARGE_CELL_V:
        return ChargeMode.PRECHARGE, Precharge.CONTINUOUS
    return ChargeMode.CHARGE, Precharge.OFF
