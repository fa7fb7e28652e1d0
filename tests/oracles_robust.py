"""A robot that walks through doorways one cell wide and may find them shut: by networkx and sums, for the tests.

Positions are cells; a way is told by its doorways.  Regions are such that the shortest way between two cells of one
stays in it.
"""

from collections.abc import Mapping, Sequence

import networkx as nx

from qualrl.qualitative.graph import crossings_of


class Robot:
    """Walks on a map from a start to a goal, 1 a step, ``goal_reward`` at the end.

    never: doorways that it knows never to be open, once it has to go round.
    """

    def __init__(self, regions, start, goal, gamma, goal_reward=100.0, never=()):
        self.regions, self.start, self.goal = regions, tuple(start), tuple(goal)
        self.gamma, self.goal_reward = gamma, goal_reward
        self.never = frozenset(never)
        self.doors = {}
        for door in regions.doorways:
            ((one, other),) = crossings_of(regions, door)  # one cell wide
            self.doors[door.name] = {self.region(one): one, self.region(other): other}
        self.inside = nx.Graph()
        height, width = regions.label.shape
        for cell in ((r, c) for r in range(height) for c in range(width) if regions.grid.free[r, c]):
            for beside in ((cell[0] + 1, cell[1]), (cell[0], cell[1] + 1)):
                is_free = beside[0] < height and beside[1] < width and regions.grid.free[beside]
                if is_free and self.region(cell) == self.region(beside):
                    self.inside.add_edge(cell, beside)

    def region(self, cell):
        return self.regions.region_names[self.regions.label[cell]]

    def ways(self, cell, shut=(), passed=()):
        """All sequences of doorways from a cell to the goal that pass no region twice."""
        here = self.region(cell)
        if here == self.region(self.goal):
            yield ()
            return
        for name, sides in self.doors.items():
            if here in sides and name not in shut:
                (there,) = [region for region in sides if region != here]
                if there not in (*passed, here):
                    for rest in self.ways(sides[there], shut, (*passed, here)):
                        yield name, *rest

    def steps(self, cell, way):
        """How many from a cell to the goal by some doorways."""
        total = 0
        for name in way:
            near, far = self.sides(name, self.region(cell))
            total, cell = total + self.apart(cell, near) + 1, far
        return total + self.apart(cell, self.goal)

    def sides(self, name, here):
        near = self.doors[name][here]
        (far,) = [cell for region, cell in self.doors[name].items() if region != here]
        return near, far

    def apart(self, one, other):
        return 0 if one == other else nx.shortest_path_length(self.inside, one, other)

    def shortest(self, cell, shut):
        """The shortest way with some doorways shut, and whether no other is as short; None where there is none."""
        found = sorted((self.steps(cell, way), way) for way in self.ways(cell, shut))
        return (found[0][1], len(found) < 2 or found[1][0] > found[0][0]) if found else None

    def worth(self, way: Sequence[str], chance: Mapping[str, float], times: Mapping[str, float]) -> float | None:
        """Expected return of a way whose doorways are open by chance; None where two ways round are as short."""
        try:
            return self._expected(self.start, tuple(way), 0, frozenset(), frozenset(), chance, times)
        except AmbiguousError:
            return None

    def _expected(self, cell, way, time, opened, shut, chance, times):
        for at, name in enumerate(way):
            here = self.region(cell)
            near, far = self.sides(name, here)
            steps = self.apart(cell, near)
            if name in chance and name not in opened:
                time += self._takes(here, steps, times)
                through = self._expected(near, way[at:], time, opened | {name}, shut, chance, times)
                return chance[name] * through + (1 - chance[name]) * self._round(
                    near, time, opened, shut | {name}, chance, times
                )
            time, cell = time + self._takes(here, steps + 1, times), far
        return self._paid(time + self._takes(self.region(cell), self.apart(cell, self.goal), times))

    def _round(self, cell, time, opened, shut, chance, times):
        shut |= self.never - opened
        found = self.shortest(cell, shut)
        if found is None:
            return -1 / (1 - self.gamma)
        if not found[1]:
            raise AmbiguousError
        return self._expected(cell, found[0], time, opened, shut, chance, times)

    def _takes(self, region, steps, times):
        return steps * times.get(region, 1) if steps > 1 else steps

    def _paid(self, time):
        """1 for each unit of time but the last, which brings the goal's reward."""
        return -(1 - self.gamma ** (time - 1)) / (1 - self.gamma) + self.goal_reward * self.gamma ** (time - 1)


class AmbiguousError(Exception):
    """Two ways are as short, so that it is not told which of them the robot takes."""
