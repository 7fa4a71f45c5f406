"""A bay's policy in force, and a newly read one that waits until the bay is in standby."""

from dataclasses import replace
from time import time

from orchestrator.config.station import BayConfig
from orchestrator.core.rules import Rules
from orchestrator.model import Cause
from orchestrator.service.news import News


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
        if bay is None or replace(bay, policy=mine.policy) != mine:
            return Cause("needs_restart")
        if bay.policy.source == mine.policy.source:
            self._offered = None
            return Cause.of("policy_unchanged", policy=name_of(bay))
        self._offered = bay
        return Cause.of("policy_offered", policy=name_of(bay))

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

    def status(self) -> dict[str, object]:
        """Its part of the status document. `since` is Unix time: when this service began, or adopted it."""
        policy, offered = self.rules.bay.policy, self._offered
        return {
            "name": policy.policy,
            "file": policy.source.file,
            "sha256": policy.source.digest,
            "since": round(self._since_s, 3),
            "waiting_sha256": offered.policy.source.digest if offered else "",
        }


def name_of(bay: BayConfig) -> Cause:
    """The name of a bay's policy, with its file."""
    source = bay.policy.source
    return Cause.of("policy", policy=bay.policy.policy, file=source.file, sha256=source.digest)
