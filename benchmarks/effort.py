"""The number of runs."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Effort:
    """Full runs, or quick ones of less than two minutes in all."""

    quick: bool = False

    def choose(self, full: int, quick: int) -> int:
        """The number of runs."""
        return quick if self.quick else full
