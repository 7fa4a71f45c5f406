"""A bay's policy in force, and a newly read one that waits until the bay is in standby."""

from dataclasses import replace
from time import time

from orchestrator.config.differences import differences
from orchestrator.config.station import BayConfig
from orchestrator.core.rules import Rules
from orchestrator.model import Cause
from orchestrator.model.document import PolicyFields
from orchestrator.service.news import News

#: More changed keys than this are counted only.
MOST_CHANGES = 6


class PolicyInForce:
    """`rules` are the rules in force, `news` tells which news matter under them.

    Used by the control loop's thread only, except `offer` and `status`.
    """

    def __init__(self, bay: BayConfig) -> None:
        self._adopt(bay)
        self._offered: BayConfig | None = None  # has a policy that is not in force yet

    def offer(self, bay: BayConfig | None) -> Cause:
        """Offer another policy, to be adopted at the next standby; returns the outcome for people. Thread-safe.

        `bay` is this bay in the present station file, None if the file no longer has it.
        """
        mine = self.rules.bay
        if bay is None:
            return Cause.of("needs_restart", changes=Cause("bay_gone"))
        if replace(bay, policy=mine.policy) != mine:
            return Cause.of("needs_restart", changes=changes(mine, replace(bay, policy=mine.policy)))
        if bay.policy.source == mine.policy.source:
            self._offered = None
            return Cause.of("policy_unchanged", policy=name_of(bay))
        self._offered = bay
        return Cause.of("policy_offered", policy=name_of(bay), changes=changes(mine.policy, bay.policy))

    @property
    def waits(self) -> bool:
        """Whether an offered policy is not in force yet."""
        return self._offered is not None

    def take_over(self) -> BayConfig | None:
        """The bay is in standby: put the offered policy into force. Returns the bay with it, None if there is none."""
        bay, self._offered = self._offered, None
        if bay is not None:
            self._adopt(bay)
        return bay

    def _adopt(self, bay: BayConfig) -> None:
        self.rules = Rules.of(bay)
        self.news = News.of(self.rules)
        self._since_s = time()

    def status(self) -> PolicyFields:
        """Its part of the status document. `since` is Unix time: when this service began, or adopted it."""
        policy, offered = self.rules.bay.policy, self._offered
        return {
            "name": policy.policy,
            "file": policy.source.file,
            "sha256": policy.source.digest,
            "since": round(self._since_s, 3),
            "waiting_sha256": offered.policy.source.digest if offered else "",
        }


def changes(before: object, after: object) -> tuple[Cause, ...]:
    """What differs between two versions of a configuration, for people; not more than a few lines of it."""
    found = list(differences(before, after))
    some = tuple(Cause.of("changed", name=one.key, before=one.before, after=one.after) for one in found[:MOST_CHANGES])
    if not some:
        return (Cause("only_text"),)
    return (*some, Cause.of("count_more", number=more)) if (more := len(found) - len(some)) else some


def name_of(bay: BayConfig) -> Cause:
    """The name of a bay's policy, with its file."""
    source = bay.policy.source
    return Cause.of("policy", policy=bay.policy.policy, file=source.file, sha256=source.digest)
