"""Slow twins of how zones are merged: places are sets of zones, all that is known of them is added up anew each time.

Trees are nested: a leaf is a number, a node (feature, threshold, what is up to it, what is above).
"""

import heapq
import math
from itertools import product
from typing import NamedTuple

DIRECTIONS = 8


class Zone(NamedTuple):
    """What is known of a zone, in metres."""

    area: float
    thick: float
    walls: float
    unknown: float
    touching: float
    peak: float
    reach: tuple[float, ...]


class Contact(NamedTuple):
    """What is known of two zones that touch or have a wall between them, in metres."""

    one: int
    other: int
    along: float
    across: float
    lined: float
    support: float
    gap: float
    wall_along: float
    wall_across: float
    way: float


def directions(count=DIRECTIONS, turn=0.0):
    """Unit vectors (row, column)."""
    angles = [turn + 2 * math.pi * number / count for number in range(count)]
    return [(math.sin(angle), math.cos(angle)) for angle in angles]


def reaches(zone, count, towards):
    """By zone and direction, over all corners of all cells."""
    found = [[-math.inf] * len(towards) for _ in range(count)]
    for row, cells in enumerate(zone):
        for column, here in enumerate(cells):
            if here >= 0:
                for k, (down, right) in enumerate(towards):
                    corners = [(row + r) * down + (column + c) * right for r, c in product((-0.5, 0.5), repeat=2)]
                    found[here][k] = max(found[here][k], *corners)
    return found


def line_around(some, line):
    """The highest line within a row and a column of any of some cells, -1 where none."""
    near = {
        number
        for row, cells in enumerate(line)
        for column, number in enumerate(cells)
        if number >= 0 and any(max(abs(row - r), abs(column - c)) <= 1 for r, c in some)
    }
    return max(near, default=-1)


def odds(trees, start, row):
    """The logarithm of the odds, as the sum of one leaf of each tree."""
    for tree in trees:
        start += leaf_of(tree, row)
    return start


def leaf_of(tree, row):
    """The leaf that a row of features comes to."""
    if not isinstance(tree, tuple):
        return tree
    feature, threshold, low, high = tree
    return leaf_of(low if row[feature] <= threshold else high, row)


def hull_area(reach):
    """Area of the polygon whose sides lie on the lines at these distances from the origin, in evenly spread directions.

    Its corners are where neighbouring lines meet.
    """
    towards = directions(len(reach))
    corners = []
    for k, far in enumerate(reach):
        (a, b), (c, d), farther = towards[k - 1], towards[k], reach[k - 1]
        whole = a * d - b * c
        corners.append(((farther * d - far * b) / whole, (a * far - c * farther) / whole))
    twice = sum(
        one[0] * other[1] - one[1] * other[0]
        for one, other in zip(corners, corners[1:] + corners[:1], strict=True)
    )  # fmt: skip
    return abs(twice) / 2


def rectangle_area(reach):
    """Area of the smallest rectangle whose sides face four of the directions."""
    quarter = len(reach) // 4
    extent = [reach[k] + reach[k + 2 * quarter] for k in range(2 * quarter)]
    return min(extent[k] * extent[k + quarter] for k in range(quarter))


def log(value):
    """No value is taken for less than a hundredth."""
    return math.log(max(value, 0.01))


class Place:
    """A set of zones, looked at from scratch."""

    def __init__(self, members, zones, contacts):
        inner = sum(
            contact.along + contact.across
            for contact in contacts
            if contact.one in members and contact.other in members
        )  # fmt: skip
        own = [zones[member] for member in members]
        self.area = sum(zone.area for zone in own)
        self.breadth = sum(zone.thick for zone in own) / self.area
        self.walls = sum(zone.walls for zone in own)
        self.unknown = sum(zone.unknown for zone in own)
        self.touching = sum(zone.touching for zone in own) - 2 * inner
        self.peak = max(zone.peak for zone in own)
        self.reach = [max(far) for far in zip(*(zone.reach for zone in own), strict=True)]

    def shares(self):
        """How much it fills of its hull, and of its rectangle."""
        return self.area / hull_area(self.reach), self.area / rectangle_area(self.reach)

    def unknown_share(self):
        return self.unknown / max(self.walls + self.unknown, 0.05)


class Merging:
    """Places as sets of zones; whoever is host keeps its number."""

    def __init__(self, zones, contacts, trees, start, about, truth=None, room=0):
        self.zones, self.contacts, self.trees, self.start, self.about = zones, contacts, trees, start, about
        self.members = {number: {number} for number in range(len(zones))}
        self.beside = {number: {} for number in range(len(zones))}
        for contact in reversed(contacts):
            self.beside[contact.one][contact.other] = self.beside[contact.other][contact.one] = None
        self.truth = None if truth is None else list(truth)
        self.samples, self.room = [], room
        self.queue, self.arrivals = [], 0
        self.stamp = dict.fromkeys(self.members, 0)

    def run(self, least_odds, min_area):
        """The host of each zone."""
        for number in self.members:
            self.ask(number, [other for other in self.beside[number] if other > number])
        while self.queue:
            negative, _, host, guest, stamps = heapq.heappop(self.queue)
            if stamps != (self.stamp.get(host), self.stamp.get(guest)):
                continue
            if -negative < least_odds:
                break
            if self.truth is not None:
                known = {self.truth[host], self.truth[guest]} - {-1}
                if len(known) == 2:
                    continue
                self.truth[host] = max(known, default=-1)
            self.join(host, guest)
            self.stamp[host] += 1
            del self.stamp[guest]
            self.ask(host, self.beside[host])
        while self.join_smallest(min_area):
            pass
        return [
            next(host for host, inside in self.members.items() if zone in inside) for zone in range(len(self.zones))
        ]

    def between(self, one, other):
        """All that is known of two places' contact, None if they do not touch."""
        ends = self.members[one], self.members[other]
        met = [
            contact[2:]
            for contact in self.contacts
            if (contact.one in ends[0] and contact.other in ends[1])
            or (contact.one in ends[1] and contact.other in ends[0])
        ]
        *lengths, ways = zip(*met, strict=True)
        total = Contact(one, other, *map(sum, lengths), max(ways))
        return total if total.along + total.across > 0 else None

    def ask(self, place, others):
        for other in others:
            contact = self.between(place, other)
            if contact is None:
                continue
            named, smaller = self.features(place, other, contact)
            row = list(named.values())
            stamps = self.stamp[place], self.stamp[other]
            heapq.heappush(self.queue, (-odds(self.trees, self.start, row), self.arrivals, place, other, stamps))
            self.arrivals += 1
            if self.truth is not None and min(self.truth[place], self.truth[other]) >= 0:
                self.samples.append([*row, self.truth[place] == self.truth[other], smaller])
                del self.samples[self.room :]

    def join(self, host, guest):
        self.members[host] |= self.members.pop(guest)
        # What was beside the guest is beside the host: after what was before, or where it came first.
        both = [*self.beside[host], *self.beside.pop(guest)]
        self.beside[host] = dict.fromkeys(other for other in both if other not in (host, guest))
        for other in self.beside[host]:
            self.beside[other] = dict.fromkeys(host if at == guest else at for at in self.beside[other])

    def join_smallest(self, min_area):
        """Whether there was a place too small with something beside it."""
        small = []
        for place, inside in self.members.items():
            area = sum(self.zones[zone].area for zone in inside)
            touched = [other for other in self.beside[place] if self.between(place, other)]
            if area < min_area and touched:
                small.append((area, place, touched))
        if not small:
            return False
        _, place, touched = min(small)
        likely = {}
        for other in touched:
            named, _ = self.features(place, other, self.between(place, other))
            likely[other] = odds(self.trees, self.start, list(named.values()))
        self.join(max(touched, key=likely.__getitem__), place)
        return True

    def features(self, one, other, contact):
        """What the trees are asked by name, in their order, and the smaller area."""
        small, large = (Place(self.members[place], self.zones, self.contacts) for place in (one, other))
        if small.area > large.area:
            small, large = large, small
        both = Place(self.members[one] | self.members[other], self.zones, self.contacts)
        length = math.sqrt(contact.along**2 + contact.across**2)
        wall = math.sqrt(contact.wall_along**2 + contact.wall_across**2)
        sides = contact.along + contact.across
        narrow, wide = sorted([small.breadth, large.breadth])
        (convex_s, fill_s), (convex_l, fill_l), (convex, fill) = small.shares(), large.shares(), both.shares()
        share = small.area / both.area
        border = max(small.walls + small.unknown + small.touching, 0.05)
        named = {
            "contact": log(length),
            "wall between": log(wall + 0.1),
            "openness": length / (length + wall),
            "way of peak": contact.way / max(min(small.peak, large.peak), 0.001),
            "way of breadth": contact.way / narrow,
            "breadth ratio": narrow / wide,
            "contact of width": log(length / narrow / 2),
            "contact of side": log(length / math.sqrt(small.area)),
            "smaller area": log(small.area),
            "larger area": log(large.area),
            "smaller convexity": convex_s,
            "larger convexity": convex_l,
            "convexity": convex,
            "smaller fill": fill_s,
            "larger fill": fill_l,
            "fill": fill,
            "smaller stretch": log(small.area / small.breadth**2),
            "larger stretch": log(large.area / large.breadth**2),
            "lined": contact.lined / sides,
            "support": contact.support / sides,
            "gap": contact.gap / sides,
            "smaller unknown": small.unknown_share(),
            "larger unknown": large.unknown_share(),
            "smaller breadth": log(small.breadth),
            "larger breadth": log(large.breadth),
            "way": log(contact.way),
            "convexity gained": convex - (share * convex_s + (1 - share) * convex_l),
            "fill gained": fill - (share * fill_s + (1 - share) * fill_l),
            "contact of border": sides / border,
            "walls of border": small.walls / border,
            "map unknown": self.about[0],
            "map zones": self.about[1],
            "map breadth": self.about[2],
        }
        return named, small.area
