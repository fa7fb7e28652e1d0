"""How much is measured, and with what."""

from dataclasses import dataclass

from tests.benchmarks.peers import Environments


@dataclass(frozen=True)
class Effort:
    """What each part of the one table is told."""

    quick: bool
    environments: Environments

    def rounds(self, usual: int, quick: int) -> int:
        """How many rounds."""
        return quick if self.quick else usual
