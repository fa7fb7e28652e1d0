"""What is known of a world's doorways and times as intervals only, given or from counts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from qualrl.errors import SettingError, UnknownNameError
from qualrl.qualitative.from_counts import Counts, Samples
from qualrl.qualitative.outlook import Number
from qualrl.spatial.region_map import RegionMap

MOST_DOORS = 6
"""Each doorway may double the ways that a plan can go."""
EVERYWHERE = "*"
"""In the stead of a region's name: every region that is not named."""
FASTEST = 0.01
"""Times as long as on the map, at least: gamma to the power of less would tell nothing."""
FADED = 1e-250

Span = tuple[float, float]


@dataclass(frozen=True)
class Uncertain:
    """Doorways and times that are not known for sure."""

    doors: Mapping[str, Span | Counts]
    """The probability that a doorway is open."""
    times: Mapping[str, Span | Samples]
    """How many times as long as on the map a region takes: one number of the interval, for every way through it; or
    how long it took, each time at random.
    """
    confidence: float = 0.95
    """With which all intervals that come from counts hold at once."""

    def __post_init__(self) -> None:
        check_confidence(self.confidence)
        if len(self.doors) > MOST_DOORS:
            raise SettingError(f"{len(self.doors)} doorways are uncertain; at most {MOST_DOORS} can be")
        for name, given in self.doors.items():
            if not isinstance(given, Counts):
                check_span(f"the probability that {name} is open", given, 0.0, 1.0)
        for name, span in self.times.items():
            if not isinstance(span, Samples):
                check_span(f"the time that {name} takes", span, FASTEST, math.inf)

    def check_names(self, regions: RegionMap) -> None:
        """Raise UnknownNameError for a name that is not on the map."""
        known = {"no doorway": [door.name for door in regions.doorways], "no region": [*regions.region_names]}
        for what, names in (("no doorway", self.doors), ("no region", self.times)):
            for name in names:
                if name not in known[what] and not (name == EVERYWHERE and names is self.times):
                    raise UnknownNameError(regions.why_not(name, what, known[what]))

    @property
    def each(self) -> float:
        """The confidence of each interval from counts: together they miss no oftener than is allowed (Bonferroni)."""
        counted = [of for of in (*self.doors.values(), *self.times.values()) if isinstance(of, Counts | Samples)]
        return 1 - (1 - self.confidence) / max(len(counted), 1)

    @property
    def fastest(self) -> float:
        """How many times as long as on the map a way takes at least; never above 1."""
        least = [0.0 if isinstance(of, Samples) else of[0] for of in self.times.values()]
        return min([1.0, *least])

    def door(self, name: str) -> Span:
        """Between what the probability lies that an uncertain doorway is open."""
        given = self.doors[name]
        return given.interval(self.each) if isinstance(given, Counts) else given

    def leg(self, region: str, gamma: float, steps: int) -> tuple[Number, Span] | None:
        """The number that a leg of some steps in a region hangs on, and its interval; None where that is known.

        A single step, as through a doorway, takes the time that it takes on the map.
        Raises SettingError where gamma fades to nothing on the way.
        """
        given = self.times.get(region, self.times.get(EVERYWHERE))
        if given is None or steps < 2:
            return None
        leg = gamma**steps
        slowest = 1.0 if isinstance(given, Samples) else given[1]
        if leg < FADED or leg**slowest < FADED:
            raise SettingError(f"gamma {gamma:g} fades to nothing in {region}, {steps} steps: choose gamma nearer to 1")
        if isinstance(given, Samples):
            return Number(f"{steps} steps in {region}"), given.interval(leg, self.each)
        return Number(region, leg), given


def check_confidence(confidence: object) -> None:
    """Raise SettingError for what is no confidence."""
    if not isinstance(confidence, int | float) or not 0 < confidence < 1:
        raise SettingError(f"confidence must be above 0 and below 1, got {confidence!r}")


def check_span(what: str, span: object, least: float, most: float) -> None:
    """Raise SettingError for what is no interval between two numbers."""
    reach = f"from {least:g} to {most:g}" if math.isfinite(most) else f"of at least {least:g}"
    wanted = f"{what} must be an interval {reach}, the lower end first"
    ends = list(span) if isinstance(span, tuple | list) else []
    if len(ends) != 2 or not all(isinstance(end, int | float) for end in ends):
        raise SettingError(f"{wanted}, as (0.6, 0.9), got {span!r}")
    low, high = ends
    if not (least <= low <= high <= most and math.isfinite(high)):
        raise SettingError(f"{wanted}, got {low:g}..{high:g}")
