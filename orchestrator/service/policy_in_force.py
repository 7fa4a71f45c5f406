"""The policy that a bay runs by, and one that has been read anew and waits until the bay stands by."""

from dataclasses import replace

from orchestrator.config.station import Bay
from orchestrator.core.rules import Rules


class PolicyInForce:
    """`rules` are what the bay is decided by. Used by the control loop's thread only, but for `offer` and `status`."""

    def __init__(self, bay: Bay) -> None:
        self.rules = Rules.of(bay)
        self._offered: Bay | None = None  # with a policy that is not in force yet

    def offer(self, bay: Bay | None) -> str:
        """Take another policy over at the next standby; what will come of it. From any thread.

        `bay` is this bay in the station file as it is now, None if it is not in there any more.
        """
        mine = self.rules.bay
        if bay is None or replace(bay, policy=mine.policy) != mine:
            return "the station file has changed here: only a restart of the service brings that into force"
        if bay.policy.source == mine.policy.source:
            self._offered = None
            return f"{name_of(bay)} is unchanged"
        self._offered = bay
        return f"{name_of(bay)} comes into force when the bay stands by"

    def take_over(self) -> Bay | None:
        """The bay stands by: what was offered is in force from now on. The bay with it, None if there is nothing."""
        bay, self._offered = self._offered, None
        if bay is not None:
            self.rules = Rules.of(bay)
        return bay

    def status(self) -> dict[str, str]:
        """Its part of the status document."""
        policy, offered = self.rules.bay.policy, self._offered
        return {
            "name": policy.policy,
            "file": policy.source.file,
            "sha256": policy.source.digest,
            "waiting_sha256": offered.policy.source.digest if offered else "",
        }


def name_of(bay: Bay) -> str:
    """The policy of a bay, and which file it is."""
    source = bay.policy.source
    return f"policy {bay.policy.policy} ({source.file}, sha256 {source.digest})"
