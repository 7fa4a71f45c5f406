"""The status document, as `orchestrator status --json` prints it and the sockets tell it: a contract with programs.

Its names and their meanings stay. New ones may come, which readers must ignore; `VERSION` changes if one goes, or means
something else, and a name that has gone is never used again. The JSON Schema (`orchestrator schema status`) and
docs/status.md are made from these records. After the type comes what the value means, then the words that it may be.
"""

from collections.abc import Mapping
from typing import Annotated, NotRequired, TypedDict

from orchestrator.model.charger import Action
from orchestrator.model.decision import Alarm, Effect
from orchestrator.model.identity import Source
from orchestrator.model.told import CauseFields, Problem, ToldCause

VERSION = 1

LEVELS = tuple(alarm.name.lower() for alarm in Alarm)
LANGUAGES = ("en", "ko")
Level = Annotated[str, "how urgently people must look: none, at a charger in standby, or at once", LEVELS]
UnixTime = Annotated[float, "Unix time, s"]


class Order(TypedDict):
    """The command that is repeated to the charger until it is seen to be carried out."""

    action: Annotated[str | None, "null: none; the charger is only asked", tuple(Action)]
    value: NotRequired[Annotated[int, "its value: a current step, charge mode or precharge"]]


class CommandFields(TypedDict):
    """What the charger should be doing; null where it decides itself."""

    operation: Annotated[int, "1: it shall run"]
    current_limit: Annotated[int | None, "current step, 0 … 4"]
    charge_mode: Annotated[int | None, "as in `charger`"]
    precharge: Annotated[int | None, "as in `charger`"]
    order: Order


class ChargerFields(Problem):
    """What the charger reports. Values are the newest received, however old; null before the first."""

    online: Annotated[bool, "whether it answers"]
    t_s: Annotated[float | None, "when this was requested, in monotonic seconds of that machine"]
    voltage_v: Annotated[float | None, "V"]
    current_a: Annotated[float | None, "A"]
    control_mode: Annotated[int | None, "0 automatic, 1 manual"]
    operation: Annotated[int | None, "0 stopped, 1 running"]
    current_limit: Annotated[int | None, "current step, 0 … 4"]
    charge_mode: Annotated[
        int | None,
        "1 search, 2 recovery, 3 precharge, 4 charge, 5 full or standby, 6 reversed, 7 system stop, 8 error stop",
    ]
    precharge: Annotated[int | None, "0 off, 1 pulse, 2 continuous"]
    connection: Annotated[int | None, "of the battery: 0 reversed, 1 normal"]
    age_s: Annotated[float | None, "how old this is, s"]
    old: Annotated[bool, "too old to be relied on"]


class BatteryFields(Problem):
    """What the BMU reports. Values are the newest received, however old; null for what was never read."""

    online: Annotated[bool, "whether it answers"]
    voltage_v: Annotated[float | None, "V"]
    current_a: Annotated[float | None, "A, positive while it is charged"]
    status: Annotated[float | None, "bits, as in its object map"]
    temperature_c: Annotated[float | None, "°C"]
    soc_pct: Annotated[float | None, "state of charge, %"]
    soh_pct: Annotated[float | None, "state of health, %"]
    time_to_full_min: Annotated[float | None, "minutes, by the BMU's own estimate"]
    time_to_empty_min: Annotated[float | None, "minutes, by the BMU's own estimate"]
    remaining_ah: Annotated[float | None, "Ah"]
    available_wh: Annotated[float | None, "Wh"]
    age_s: Annotated[Mapping[str, float | None], "how old each value is, s, by its name"]
    old: Annotated[list[str], "the names of the values that are too old to be relied on"]


class Fault(TypedDict):
    """An active fault. The most dangerous one comes first."""

    id: Annotated[str, "which fault it is, for programs (faults.md)"]
    effect: Annotated[str, "what it does", tuple(effect.name for effect in Effect)]
    cause: Annotated[ToldCause | None, "its evidence, its times and figures, and what to do"]
    text: Annotated[str, "the sentence for that"]
    since: UnixTime
    gone_since: Annotated[float | None, "since when what raised it is gone, Unix time, s; null: it is there"]
    clears: Annotated[ToldCause | None, "what ends it: a command, a time, a condition"]
    clears_at: Annotated[float | None, "when that is, if it is a time, Unix time, s"]


class SessionFields(TypedDict):
    """The charge that is going on, or has just ended. A pause does not end it."""

    elapsed_s: Annotated[float, "s since it began"]
    energised_s: Annotated[float, "s during which the charger was commanded to run"]
    charged_ah: Annotated[float, "Ah"]
    charged_wh: Annotated[float, "Wh"]
    soc_start_pct: Annotated[float | None, "%"]
    soc_pct: Annotated[float | None, "%"]
    step_changes: Annotated[int, "how often the current step was changed"]
    result: Annotated[str, "why it ended; empty while it goes on"]
    cause: Annotated[CauseFields | None, "the same as data"]


class Next(ToldCause):
    """What happens next, and whose turn it is."""

    by_itself: Annotated[bool, "whether the bay goes on without a person"]
    at: Annotated[float | None, "when, as far as known, Unix time, s"]


class Target(ToldCause):
    """The target of this one charge."""

    soc_pct: Annotated[float, "%"]


class TimedStart(ToldCause):
    """A start that was asked for later, or why it was not made."""

    at: UnixTime
    target_soc_pct: Annotated[float | None, "the target of that charge, %; null: by the policy"]
    pending: Annotated[bool, "it is still to come"]


class Limit(TypedDict):
    """One limit of the charge."""

    allowed_a: Annotated[float | None, "the current that it allows, A; null for a limit of something else"]
    binds: Annotated[bool, "it sets the current step"]
    cause: Annotated[ToldCause | None, "what it is"]
    text: Annotated[str, "the sentence for that"]


class Forecast(TypedDict):
    """How long the charge still takes."""

    target_soc_pct: Annotated[float, "where it ends, %"]
    goes_full: Annotated[bool, "this charge goes all the way, to balance the cells"]
    key: Annotated[str, "the key that sets the target"]
    place: Annotated[str, "FILE:LINE of that key"]
    bmu_min: Annotated[float | None, "minutes, by the BMU"]
    bmu_at: Annotated[float | None, "then, Unix time, s"]
    own_min: Annotated[float | None, "minutes, by our own estimate"]
    own_at: Annotated[float | None, "then, Unix time, s"]


class IdentityFields(TypedDict):
    """Which battery it is."""

    id: Annotated[str, "as in the record of batteries"]
    source: Annotated[str, "how that is known", tuple(Source)]
    typed: Annotated[str, "what an operator has typed; empty if nothing"]
    contradicted: Annotated[bool, "the BMU's serial number says otherwise"]
    cause: Annotated[CauseFields, "the same as data"]
    text: Annotated[str, "the sentence for that"]


class ContactorFields(Problem):
    """The contactor between charger and battery."""

    closed: bool


class SupplyFields(TypedDict):
    """A supply that bays share."""

    name: str
    within: Annotated[str | None, "the supply that feeds it"]
    limit_w: Annotated[int, "its limit, W"]
    promised_w: Annotated[int, "what its bays count with together, at worst, W"]
    waiting: Annotated[list[str], "the bays that it grants no step although they could charge"]
    cause: Annotated[ToldCause, "the same as data"]
    text: Annotated[str, "the sentence for that"]


class SupplyShare(TypedDict):
    """What the bay has of its supply. The figures in its cause are those of the moment when this became the reason."""

    name: Annotated[str, "of the supply that the bay is directly on"]
    granted: Annotated[int, "the highest level that the bay may use: 0 none, 1 the lowest step …"]
    granted_w: Annotated[int, "what its charger draws on that at most, W"]
    counted_w: Annotated[int, "what the bay counts with in the supply until less is seen, W"]
    cause: Annotated[ToldCause, "why it is granted no more"]
    text: Annotated[str, "the sentence for that"]


class Bmu(TypedDict):
    """Where the BMU is."""

    can: Annotated[str, "the station's name of the bus"]
    node_id: int


class PolicyFields(TypedDict):
    """The policy in force."""

    name: str
    file: str
    sha256: Annotated[str, "of the file, as `sha256sum` shows it"]
    since: Annotated[float, "when it came into force, or the service began, Unix time, s"]
    waiting_sha256: Annotated[str, "of a newer one that waits until the bay stands by; empty without"]
