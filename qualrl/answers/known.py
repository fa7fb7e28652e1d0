"""What is known of uncertain doorways and times, in words."""

from collections.abc import Iterator

from qualrl.answers.answer import in_sign, likelihood
from qualrl.answers.depth import Depth
from qualrl.answers.uncertain import EVERYWHERE, Span, Uncertain
from qualrl.answers.ways import LENGTHS
from qualrl.qualitative.from_counts import Counts, Samples


def known_in_words(known: Uncertain, depth: Depth) -> Iterator[str]:
    """A line a doorway, a line a region, and how sure it is what was counted."""
    for name, given in known.doors.items():
        seen = f", as it was in {given.hits} of {given.trials} cases" if isinstance(given, Counts) else ""
        span = known.door(name)
        if depth == Depth.NUMBERS:
            yield f"{name} is open with a probability of {between(*span)}{seen}"
        else:
            how = "was counted" if isinstance(given, Counts) else "is given"
            yield f"the chance that {name} is open {how}{depth.from_signs(f': that it is open is {likelihood(*span)}')}"
    for name, times in known.times.items():
        place = "every other region" if name == EVERYWHERE and len(known.times) > 1 else name
        place = "every region" if place == EVERYWHERE else place
        if depth == Depth.NUMBERS:
            yield f"{place} {_time_in_words(times)}"
        else:
            how = "was measured" if isinstance(times, Samples) else "is given"
            yield f"the time of {place} {how}{depth.from_signs(f': {_time_in_signs(times)}, compared with the map')}"
    is_counted = any(isinstance(of, Counts | Samples) for of in (*known.doors.values(), *known.times.values()))
    if is_counted and depth != Depth.NAMES:
        confidence = depth.at_numbers(f"a confidence of {known.confidence:g}", "the confidence asked for")
        yield f"what was counted holds with {confidence}, all of it at once"


def between(low: float, high: float) -> str:
    """An interval; one number where both ends read the same."""
    ends = f"{low:.6g}", f"{high:.6g}"
    return " to ".join(dict.fromkeys(ends))


def _time_in_words(times: Span | Samples) -> str:
    if not isinstance(times, Samples):
        return f"takes {between(*times)} times as long as on the map"
    return f"took {between(min(times.times), max(times.times))} times as long in {len(times.times)} cases"


def _time_in_signs(times: Span | Samples) -> str:
    """Shorter, as long, longer, or all that may be."""
    ends = (min(times.times), max(times.times)) if isinstance(times, Samples) else times
    return " or ".join(dict.fromkeys(in_sign(end - 1, 1, LENGTHS) for end in ends))
