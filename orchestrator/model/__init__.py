"""The records that travel through the system, all frozen: readings in, a decision out.

Units are in the names. `t_s` is the monotonic time, in seconds, at which a value was *requested*, so that an age
computed from it is never too young. Unknown is `None`, never a number.
"""

from orchestrator.model.battery import BatteryLink, BatteryReading, BatteryStatus, Measurement
from orchestrator.model.cause import Cause
from orchestrator.model.charger import (
    STOP,
    Action,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    ErrorBit,
    Operation,
    Precharge,
    Sent,
)
from orchestrator.model.decision import (
    STANDBY,
    Account,
    ActiveFault,
    Alarm,
    CurrentStep,
    Decision,
    Effect,
    Request,
    Session,
    Setpoint,
    Snapshot,
    State,
)

__all__ = [
    "STANDBY",
    "STOP",
    "Account",
    "Action",
    "ActiveFault",
    "Alarm",
    "BatteryLink",
    "BatteryReading",
    "BatteryStatus",
    "Cause",
    "ChargeMode",
    "ChargerLink",
    "ChargerReading",
    "Command",
    "Connection",
    "ControlMode",
    "CurrentStep",
    "Decision",
    "Effect",
    "ErrorBit",
    "Measurement",
    "Operation",
    "Precharge",
    "Request",
    "Sent",
    "Session",
    "Setpoint",
    "Snapshot",
    "State",
]
