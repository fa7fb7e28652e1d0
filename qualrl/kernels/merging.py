"""Zones are merged into places, the likeliest pair first, as decision trees tell how likely two are one.

Z: zones.  E: contacts between zones.  D: directions.  T: trees.  All lengths are in metres.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.bonds import Bonds, append, find, tidy
from qualrl.kernels.jit import compiled_bare, compiled_part
from qualrl.kernels.pair_queue import Queue, grown, new_queue, pop, push
from qualrl.kernels.trees import ALL_LEAVES, Questions, Words, odds, take_away

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

AREA, THICK, WALLS, UNKNOWN, TOUCHING = 0, 1, 2, 3, 4
"""Columns of ``Places.sums``: square metres, these times half-width, and metres of border by what is beyond it."""
ALONG, ACROSS, LINED, SUPPORT, GAP, WALL_ALONG, WALL_ACROSS, WAY = 0, 1, 2, 3, 4, 5, 6, 7
"""Columns of ``bonds.sums``: contact seen along rows and along columns, how much of it lies on lines, these times the
lines' support and gap, wall between the two seen along both, and the half-width of the widest way (the largest)."""

FEATURES = (
    "contact", "wall between", "openness", "way of peak", "way of breadth", "breadth ratio", "contact of width",
    "contact of side", "smaller area", "larger area", "smaller convexity", "larger convexity", "convexity",
    "smaller fill", "larger fill", "fill", "smaller stretch", "larger stretch", "lined", "support", "gap",
    "smaller unknown", "larger unknown", "smaller breadth", "larger breadth", "way", "convexity gained", "fill gained",
    "contact of border", "walls of border", "map unknown", "map zones", "map breadth",
)  # fmt: skip
"""What the trees are asked about; "smaller" and "larger" are the two places by area."""
OF_MAP = 3
"""So many features, the last ones, are those of the map."""
OF_SMALLER = np.array([at for at, name in enumerate(FEATURES) if "smaller" in name or name == "walls of border"])
OF_LARGER = np.array([at for at, name in enumerate(FEATURES) if "larger" in name])
OF_PAIR = np.setdiff1d(np.arange(len(FEATURES) - OF_MAP), [*OF_SMALLER, *OF_LARGER])
"""Features by what they are of."""


class Places(NamedTuple):
    """Places, at first one for each zone; places that were merged into others are left as they were."""

    parent: Ints
    """(Z,) the place each was merged into, itself at first."""
    sums: Floats
    """(Z, 5) see AREA and the rest."""
    peak: Floats
    """(Z,) largest half-width."""
    reach: Floats
    """(Z, D) how far it reaches in D directions, evenly spaced; D is a multiple of 4."""


class Samples(NamedTuple):
    """What a walk with known truth meets; all empty otherwise."""

    truth: Ints
    """(Z,) the true place of each zone, -1 where unknown."""
    found: Floats
    """(capacity, features + 2) features, whether the two are one, and the smaller area."""
    size: NDArray[np.int64]
    """(1,) how many were found."""


class Asked(NamedTuple):
    """The trees, and what is known of the pairs of one place: its tests are made once for all of them."""

    questions: Questions
    features: Floats
    """Of a pair."""
    of_map: Words
    """(T,) the leaves that the tests of the map's features leave."""
    of_place: Words
    """(2, T) ... that also those of the place leave, as the larger of a pair (0) and as the smaller (1)."""
    is_tested: NDArray[np.bool_]
    """(2,) whether that is known."""
    left_over: Words
    """(T,) scratch"""


def merge(
    places: Places,
    bonds: Bonds,
    chosen: NDArray[np.int64],
    questions: Questions,
    about: Floats,
    least_odds: float,
    min_area: float,
    samples: Samples,
) -> None:
    """Merge places while the likeliest pair has at least those odds (logarithm), then those smaller than the area.

    places and bonds are updated; ``places.parent`` then holds the root of each zone.  chosen: the zones to merge, in
    their order; no bonds lead to any others, which are left alone.  about (3,): the features of the whole map.  With
    truth known, what is not one place is never merged, and pairs are added to the samples.
    """
    zones, trees, every = len(places.parent), len(questions.first_leaf), len(FEATURES)
    of_map, of_place, left_over = (np.empty(shape, np.uint64) for shape in (trees, (2, trees), trees))
    asked = Asked(questions, np.empty(every), of_map, of_place, np.zeros(2, np.bool_), left_over)
    stamp, seen, waiting = np.zeros(zones, np.int64), np.full(zones, -1, np.int32), chosen.copy()
    queue = new_queue(4 * len(bonds.target) + 16)
    while not _merge(places, bonds, chosen, about, asked, queue, stamp, seen, waiting, least_odds, min_area, samples):
        queue = grown(queue, zones)


@compiled_bare
def _merge(
    places: Places, bonds: Bonds, chosen: NDArray[np.int64], about: Floats, asked: Asked, queue: Queue,
    stamp: NDArray[np.int64], seen: Ints, waiting: NDArray[np.int64], least_odds: float, min_area: float,
    samples: Samples,
) -> bool:  # fmt: skip
    """Merge until all is done, or the queue has no room: then go on with one that has.

    stamp (Z,): how often each place was merged with others, -1 once it is part of another; 0 at first.  seen (Z,), all
    -1, and waiting, those chosen, are scratch.
    """
    _test_map(about, asked)
    if not queue.size[1]:  # there is room for all pairs
        for zone in chosen:
            tidy(zone, places.parent, bonds, seen)
            _ask(zone, places, bonds, asked, stamp, queue, samples)
    while queue.size[0]:
        if queue.size[0] + len(stamp) > len(queue.key):
            return False
        likely = queue.key[0]
        host, guest = queue.item[0, 1], queue.item[0, 2]
        is_old = queue.item[0, 3] != stamp[host] or queue.item[0, 4] != stamp[guest]
        pop(queue)
        if is_old:
            continue
        if likely < least_odds:
            break
        if len(samples.truth) and not _is_true(host, guest, samples.truth):
            continue
        _join(host, guest, places, bonds)
        stamp[host] += 1
        stamp[guest] = -1
        tidy(host, places.parent, bonds, seen)
        _ask(host, places, bonds, asked, stamp, queue, samples)
    if min_area > 0:
        _join_small(places, bonds, waiting, asked, min_area, seen)
    for zone in chosen:
        places.parent[zone] = find(places.parent, zone)
    return True


@compiled_part
def _test_map(about: Floats, asked: Asked) -> None:
    """Take away the leaves that the features of the map do."""
    for tree in range(len(asked.of_map)):
        asked.of_map[tree] = ALL_LEAVES
    for at in range(OF_MAP):
        feature = len(FEATURES) - OF_MAP + at
        asked.features[feature] = about[at]
        take_away(asked.questions, feature, about[at], asked.of_map)


@compiled_part
def _is_true(host: int, guest: int, truth: Ints) -> bool:
    """Whether two places may be one; if so the host's truth is known when the guest's is."""
    if truth[host] >= 0 and truth[guest] >= 0 and truth[host] != truth[guest]:
        return False
    if truth[host] < 0:
        truth[host] = truth[guest]
    return True


@compiled_part
def _ask(
    place: int, places: Places, bonds: Bonds, asked: Asked, stamp: NDArray[np.int64], queue: Queue, samples: Samples
) -> None:
    """Put a place's pairs into the queue; at first, when each is met from both, only those with a later neighbour."""
    _forget_tests(asked)
    half = bonds.first[place]
    while half >= 0:
        other = bonds.target[half]
        if bonds.sums[half, ALONG] + bonds.sums[half, ACROSS] > 0 and (stamp[place] > 0 or other > place):
            push(queue, _odds(place, other, half, places, bonds, asked), place, other, stamp[place], stamp[other])
            if len(samples.truth) and samples.truth[place] >= 0 and samples.truth[other] >= 0:
                at = samples.size[0]
                if at < len(samples.found):
                    for column in range(len(FEATURES)):
                        samples.found[at, column] = asked.features[column]
                    samples.found[at, len(FEATURES)] = samples.truth[place] == samples.truth[other]
                    samples.found[at, len(FEATURES) + 1] = min(places.sums[place, AREA], places.sums[other, AREA])
                    samples.size[0] = at + 1
        half = bonds.following[half]


@compiled_part
def _join(host: int, guest: int, places: Places, bonds: Bonds) -> None:
    """Merge the guest into the host."""
    half = bonds.first[host]
    while bonds.target[half] != guest:
        half = bonds.following[half]
    inner = bonds.sums[half, ALONG] + bonds.sums[half, ACROSS]
    places.parent[guest] = host
    for column in range(places.sums.shape[1]):
        places.sums[host, column] += places.sums[guest, column]
    places.sums[host, TOUCHING] -= 2 * inner
    places.peak[host] = max(places.peak[host], places.peak[guest])
    for k in range(places.reach.shape[1]):
        places.reach[host, k] = max(places.reach[host, k], places.reach[guest, k])
    append(host, guest, bonds)


@compiled_part
def _join_small(
    places: Places, bonds: Bonds, waiting: NDArray[np.int64], asked: Asked, min_area: float, seen: Ints
) -> None:
    """Merge each place of less area into its likeliest neighbour, the smallest first; those without one stay."""
    count = waiting.size
    while True:
        smallest, before, count = -1, count, 0
        for at in range(before):
            place = waiting[at]
            if places.parent[place] != place or places.sums[place, AREA] >= min_area:
                continue
            if smallest < 0 or places.sums[place, AREA] < places.sums[waiting[smallest], AREA]:
                tidy(place, places.parent, bonds, seen)
                if not _touches(place, bonds):
                    continue  # nor will it ever
                smallest = count
            waiting[count] = place
            count += 1
        if smallest < 0:
            return
        small = waiting[smallest]
        host = _likeliest(small, places, bonds, asked)
        tidy(host, places.parent, bonds, seen)
        _join(host, small, places, bonds)
        tidy(host, places.parent, bonds, seen)


@compiled_part
def _touches(place: int, bonds: Bonds) -> bool:
    half = bonds.first[place]
    while half >= 0:
        if bonds.sums[half, ALONG] + bonds.sums[half, ACROSS] > 0:
            return True
        half = bonds.following[half]
    return False


@compiled_part
def _likeliest(place: int, places: Places, bonds: Bonds, asked: Asked) -> int:
    """The neighbour that a place is likeliest one with, -1 if it touches none."""
    best, most = -1, -np.inf
    _forget_tests(asked)
    half = bonds.first[place]
    while half >= 0:
        if bonds.sums[half, ALONG] + bonds.sums[half, ACROSS] > 0:
            likely = _odds(place, bonds.target[half], half, places, bonds, asked)
            if likely > most:
                best, most = bonds.target[half], likely
        half = bonds.following[half]
    return best


@compiled_part
def _odds(place: int, other: int, half: int, places: Places, bonds: Bonds, asked: Asked) -> float:
    """The logarithm of the odds that two are one; the place is the one that was asked about before."""
    is_small = np.int64(places.sums[place, AREA] <= places.sums[other, AREA])
    small, large = (place, other) if is_small else (other, place)
    _describe(small, large, half, places, bonds, asked.features)
    of_place, left_over = asked.of_place[is_small], asked.left_over
    if not asked.is_tested[is_small]:
        _copy(asked.of_map, of_place)
        _test_one(is_small == 1, asked, of_place)
        asked.is_tested[is_small] = True
    _copy(of_place, left_over)
    _test_one(is_small == 0, asked, left_over)
    for feature in OF_PAIR:
        take_away(asked.questions, feature, asked.features[feature], left_over)
    return odds(asked.questions, left_over)


@compiled_part
def _forget_tests(asked: Asked) -> None:
    """What is known of one place's pairs is not known of another's."""
    asked.is_tested[0] = asked.is_tested[1] = False


@compiled_part
def _copy(source: Words, target: Words) -> None:
    for tree in range(len(source)):
        target[tree] = source[tree]


@compiled_part
def _test_one(is_small: bool, asked: Asked, left_over: Words) -> None:
    """Take away the leaves that the features of the pair's smaller or larger place do."""
    for feature in OF_SMALLER if is_small else OF_LARGER:
        take_away(asked.questions, feature, asked.features[feature], left_over)


@compiled_part
def _describe(small: int, large: int, half: int, places: Places, bonds: Bonds, features: Floats) -> None:
    """Write the features of two places that touch, the smaller and the larger one; see FEATURES."""
    bond = bonds.sums[half]
    contact = np.hypot(bond[ALONG], bond[ACROSS])
    sides = bond[ALONG] + bond[ACROSS]
    wall = np.hypot(bond[WALL_ALONG], bond[WALL_ACROSS])
    area_s, area_l = places.sums[small, AREA], places.sums[large, AREA]
    breadth_s, breadth_l = places.sums[small, THICK] / area_s, places.sums[large, THICK] / area_l
    narrow = min(breadth_s, breadth_l)
    walls, unknown = places.sums[small, WALLS], places.sums[small, UNKNOWN]
    border = max(walls + unknown + places.sums[small, TOUCHING], 0.05)
    convex_s, fill_s = _fullness(area_s, places.reach[small], places.reach[small])
    convex_l, fill_l = _fullness(area_l, places.reach[large], places.reach[large])
    convex, fill = _fullness(area_s + area_l, places.reach[small], places.reach[large])
    features[0] = _log(contact)
    features[1] = _log(wall + 0.1)
    features[2] = contact / (contact + wall)
    features[3] = bond[WAY] / max(min(places.peak[small], places.peak[large]), 1e-3)
    features[4] = bond[WAY] / narrow
    features[5] = narrow / max(breadth_s, breadth_l)
    features[6] = _log(contact / (2 * narrow))
    features[7] = _log(contact / np.sqrt(area_s))
    features[8], features[9] = _log(area_s), _log(area_l)
    features[10], features[11], features[12] = convex_s, convex_l, convex
    features[13], features[14], features[15] = fill_s, fill_l, fill
    features[16], features[17] = _log(area_s / breadth_s**2), _log(area_l / breadth_l**2)
    features[18], features[19], features[20] = bond[LINED] / sides, bond[SUPPORT] / sides, bond[GAP] / sides
    features[21] = unknown / max(walls + unknown, 0.05)
    features[22] = places.sums[large, UNKNOWN] / max(places.sums[large, WALLS] + places.sums[large, UNKNOWN], 0.05)
    features[23], features[24] = _log(breadth_s), _log(breadth_l)
    features[25] = _log(bond[WAY])
    features[26] = convex - (convex_s * area_s + convex_l * area_l) / (area_s + area_l)
    features[27] = fill - (fill_s * area_s + fill_l * area_l) / (area_s + area_l)
    features[28], features[29] = sides / border, walls / border


@compiled_part
def _log(value: float) -> float:
    return float(np.log(max(value, 1e-2)))


@compiled_part
def _fullness(area: float, one: Floats, other: Floats) -> tuple[float, float]:
    """What share two places fill together of their hull, and of the smallest rectangle around it.

    The hull is that of the D directions: its side in each of them has a length that follows from three reaches.
    """
    count = len(one)
    turn = 2 * np.pi / count
    hull, rectangle = 0.0, np.inf
    quarter = count // 4
    for k in range(count):
        here = max(one[k], other[k])
        before, after = max(one[k - 1], other[k - 1]), max(one[(k + 1) % count], other[(k + 1) % count])
        hull += 0.5 * here * (before + after - 2 * here * np.cos(turn)) / np.sin(turn)
        if k < quarter:
            left = max(one[k + quarter], other[k + quarter])
            back = max(one[k + 2 * quarter], other[k + 2 * quarter])
            right = max(one[k + 3 * quarter], other[k + 3 * quarter])
            rectangle = min(rectangle, (here + back) * (left + right))
    return area / max(hull, 1e-6), area / max(rectangle, 1e-6)
