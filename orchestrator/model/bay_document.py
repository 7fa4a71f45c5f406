"""The bays and the station in the status document (`document.py`, which says what holds for all of it)."""

from typing import Annotated, NotRequired, TypedDict

from orchestrator.model.decision import State
from orchestrator.model.document import (
    LANGUAGES,
    BatteryFields,
    Bmu,
    ChargerFields,
    CommandFields,
    ContactorFields,
    Fault,
    Forecast,
    IdentityFields,
    Level,
    Limit,
    Next,
    PolicyFields,
    SessionFields,
    SupplyFields,
    SupplyShare,
    Target,
    TimedStart,
    UnixTime,
)
from orchestrator.model.told import Problem, ToldCause


class BayState(TypedDict):
    """What one bay does, and why."""

    name: str
    state: Annotated[str, "what it does (architecture.md)", tuple(State)]
    reason: Annotated[str, "why it is in this state, for people"]
    cause: Annotated[ToldCause | None, "the same as data"]
    step: Annotated[int | None, "the current step in force, 0 … 4 (people see 1 … 5); null while no current shall flow"]
    step_current_a: Annotated[float | None, "what flows at most on it, A"]
    step_rule: Annotated[str, "what limits it, for people"]
    step_cause: Annotated[ToldCause | None, "the same as data"]
    step_key: Annotated[str, "the key that sets this limit; empty without one"]
    step_place: Annotated[str, "FILE:LINE of that key"]
    command: CommandFields
    charger: ChargerFields
    battery: BatteryFields
    faults: list[Fault]
    alarm: Level
    session: Annotated[SessionFields | None, "null: no charge is going on"]


class Outlook(TypedDict):
    """What is around and ahead of a bay."""

    since: Annotated[float | None, "since when it is in this state, Unix time, s; null before the first decision"]
    next: Next
    target: Annotated[Target | None, "null: by the policy"]
    limits: NotRequired[Annotated[list[Limit], "the lowest first; only where one bay is asked for"]]
    forecast: NotRequired[Annotated[Forecast | None, "null without a charge; only where one bay is asked for"]]


class Waiting(TypedDict, total=False):
    """What replaces `next` while nothing but a time is waited for."""

    next: Next


class Supplied(TypedDict, total=False):
    """What a bay in a supply has besides."""

    supply: SupplyShare


class BayEntry(BayState, Outlook):
    """One bay."""

    supply: NotRequired[Annotated[SupplyShare, "only of a bay in a supply"]]
    identity: IdentityFields
    timed_start: Annotated[TimedStart | None, "null: none was asked for"]
    contactor: Annotated[ContactorFields | None, "null: there is none"]
    port: Annotated[str, "the charger's serial port"]
    bmu: Bmu
    policy: PolicyFields


class Stray(Problem):
    """A charger of a bay that the station file does not have any more."""

    bay: str
    port: str
    state: Annotated[str, "STOPPING, or HELD once it is verified", ("STOPPING", "HELD")]
    verified: Annotated[bool, "whether it stands by"]


class JournalFields(Problem):
    """The journal."""

    directory: str


class StationFields(TypedDict):
    """Everything but the bays."""

    version: Annotated[int, "of this document"]
    time: UnixTime
    station: Annotated[str, "its name"]
    language: Annotated[str, "of the texts", LANGUAGES]
    alarm: Annotated[Level, "the worst of all bays, those that are not shown included, and of all strays"]
    strays: list[Stray]
    journal: JournalFields
    persisted: Annotated[Problem, "whether a restart would forget something"]
    supplies: NotRequired[Annotated[list[SupplyFields], "as in the station file; only where there are any"]]


class Shared(TypedDict, total=False):
    """What a station has besides whose bays share supplies."""

    supplies: list[SupplyFields]


class Status(StationFields):
    """The whole document."""

    bays: Annotated[list[BayEntry], "in the order of the station file"]
