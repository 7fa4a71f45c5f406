"""The battery as reported by its BMU."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

from orchestrator.model.cause import Cause


@dataclass(frozen=True, slots=True)
class Measurement:
    """A decoded value, in range, and when it was requested."""

    value: float
    t_s: float


class BatteryStatus(IntEnum):
    """Bits of the BMU's status word (inferred, see the object map)."""

    OVER_VOLTAGE = 0
    LOW_VOLTAGE = 1
    CHARGE_OVER_CURRENT = 2
    DISCHARGE_OVER_CURRENT = 3
    HIGH_TEMPERATURE = 4
    LOW_TEMPERATURE = 5
    BMU_ERROR = 6


@dataclass(frozen=True, slots=True)
class BatteryReading:
    """The newest valid value of each field; None until one arrives. An object map may use these field names."""

    voltage_v: Measurement | None = None
    current_a: Measurement | None = None  #: positive while charging
    status: Measurement | None = None  #: bits, `BatteryStatus`
    temperature_c: Measurement | None = None
    soc_pct: Measurement | None = None
    soh_pct: Measurement | None = None
    time_to_full_min: Measurement | None = None
    time_to_empty_min: Measurement | None = None
    remaining_ah: Measurement | None = None
    available_wh: Measurement | None = None


@dataclass(frozen=True, slots=True)
class BatteryLink:
    """The state of the link to a BMU. Silence and refusal are two different faults."""

    online: bool = False  #: it answered within the stale limit
    problem: Cause | None = None  #: why not
    boots: int = 0  #: boot-up frames seen
    boot_t_s: float | None = None  #: when the newest arrived
    heartbeat_s: float | None = None  #: period accepted by the BMU, None while there is none
    heartbeat_t_s: float | None = None  #: newest heartbeat, or when it was armed
    nmt_state: int | None = None
    abort: Cause | None = None  #: a read that the BMU refuses: object, code and meaning; None once it answers again
    abort_code: int = 0
    implausible: Mapping[str, Cause] = field(default_factory=dict)  #: field → why its newest value was thrown away
    emergency: Cause | None = None  #: newest EMCY that is not "error reset"
    bad_frames: int = 0  #: frames of this node discarded: wrong length, not understood, late or second answers
    other_master: Cause | None = None  #: what another CANopen master was last seen to do with this node
    other_master_t_s: float | None = None  #: when that was
    heartbeat_set: Cause | None = None  #: what somebody else had set this node's heartbeat to when that was last found
    heartbeat_set_t_s: float | None = None  #: when that was; ours was written again at once
    serial: int | None = None  #: serial number since it was last heard anew; 0: it has none; None: not read yet
