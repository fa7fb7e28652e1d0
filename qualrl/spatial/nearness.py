"""Which distances are near, and which far."""

import math
from dataclasses import dataclass

from qualrl.errors import SettingError

ROUNDING_M = 1e-9
"""So much more than a cut is still the same: steps times metres a step are rounded."""


@dataclass(frozen=True)
class DistanceCuts:
    """Where a walking distance in metres stops being near, and begins to be far."""

    near_m: float = 10.0
    far_m: float = 25.0

    def __post_init__(self) -> None:
        if not 0 < self.near_m < self.far_m < math.inf:
            raise SettingError(f"near_m must be above 0 and below far_m, got near_m {self.near_m}, far_m {self.far_m}")

    def name(self, distance_m: float) -> str:
        """The class: "near" (up to near_m), "medium" (up to far_m), or "far" (beyond, or where no way leads).

        >>> DistanceCuts().name(10), DistanceCuts().name(math.inf)
        ('near', 'far')
        """
        cut_m = distance_m - ROUNDING_M
        return "near" if cut_m <= self.near_m else "medium" if cut_m <= self.far_m else "far"
