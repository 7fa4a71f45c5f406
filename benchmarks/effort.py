"""How much is measured."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Effort:
    """All of it, or what takes less than two minutes."""

    quick: bool = False

    def choose(self, full: int, quick: int) -> int:
        """The number of runs."""
        return quick if self.quick else full
