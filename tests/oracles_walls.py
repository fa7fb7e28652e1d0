"""Slow twins of what finds gaps in walls, and walls between zones: rows as words, plain Python."""

import re
from itertools import combinations, groupby, pairwise


def gaps(wall, free, bridge, least, most):
    """{(row, first, last, length before, length after)}; a wall is a word of '#' and fewer than bridge '.' at once."""
    found = set()
    word = re.compile(rf"#(?:\.{{0,{bridge - 1}}}#)*")
    for row, cells in enumerate(wall):
        text = "".join(".#"[int(cell)] for cell in cells)
        walls = [hit for hit in word.finditer(text) if len(hit[0]) >= least and hit[0].count(".") <= hit[0].count("#")]
        for one, other in pairwise(walls):
            between = range(one.end(), other.start())
            if len(between) <= most and any(free[row][column] for column in between):
                found.add((row, between[0], between[-1], len(one[0]), len(other[0])))
    return found


def side_by_side(one, other, rows, slack):
    """Whether gaps (row, first, last) lie within so many rows, with fewer than slack columns between them."""
    columns_between = max(one[1] - other[2], other[1] - one[2]) - 1
    return abs(one[0] - other[0]) <= rows and columns_between < slack


def apart(gaps, order, rows, slack):
    """The gaps that stay, by number."""
    stays = []
    for gap in order:
        if not any(side_by_side(gaps[gap], gaps[kept], rows, slack) for kept in stays):
            stays.append(gap)
    return set(stays)


def walls_between(zone, most):
    """[(zone before, zone after, axis)] of each wall of at most so many cells, sorted."""
    found = []
    for axis, lines in enumerate((zone.tolist(), zone.T.tolist())):
        for line in lines:
            at = 0
            runs = []
            for here, cells in groupby(line):
                runs.append((here, at, at := at + len(list(cells))))
            inside = [run for run in runs if run[0] >= 0]
            found += [
                (one[0], other[0], axis)
                for one, other in combinations(inside, 2)
                if one[0] != other[0] and 0 < other[1] - one[2] <= most and (-1, one[2], other[1]) in runs
            ]
    return sorted(found)


def is_single_gap(around):
    """Whether of three by three cells only those left and right of the middle, or above and below it, are not free."""
    bars = ([[True] * 3, [False, True, False], [True] * 3], [[True, False, True], [True] * 3, [True, False, True]])
    return around in bars


def off_middle(found):
    """How far each (row, ...) is off the middle of those in adjoining rows that are like it otherwise, in half rows."""
    everything = {tuple(gap) for gap in found}
    off = []
    for row, *rest in found:
        top = bottom = row
        while (top - 1, *rest) in everything:
            top -= 1
        while (bottom + 1, *rest) in everything:
            bottom += 1
        off.append(abs(2 * row - top - bottom))
    return off


def sharpness(points, cosine, sine):
    """The sum of squares of how many turned points (x, y) lie in each row, and in each column."""
    total = 0
    for along in ([x * cosine + y * sine for x, y in points], [y * cosine - x * sine for x, y in points]):
        rows = [round(at - min(along)) for at in along]
        total += sum(rows.count(row) ** 2 for row in {*rows})
    return total
