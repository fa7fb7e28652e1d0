"""Ways across large buildings: seconds a question, beside Dijkstra on the grid in scipy.

    python -m tests.benchmarks.routes [--largest 4000]

"building": blocks of four rooms each along a grid of corridors, 0.05 m a cell, doors where chance puts them.  "plans":
the generated floor plans of ``tests.benchmarks.maps``, which nothing connects to each other, so ways are short.
Questions: random pairs of cells between which a way leads.  "graph": the part of it that is a search over doorways,
median (largest).  "exact": the shortest way of all.  Longer: how much longer the quick way is, mean (largest).  CPU
seconds, medians; scipy: of two questions.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

import qualrl
from qualrl.models.grid_world import GridWorld
from qualrl.planning.gate_graph import GateGraph
from qualrl.planning.routes import Route, Routes
from tests.benchmarks.effort import Effort
from tests.benchmarks.maps import image
from tests.benchmarks.table import WITHIN_BOUND, Row, at_least, at_most

SIDES = (1000, 2000, 4000)
BLOCK, CORRIDOR, WALL, DOOR = 250, 44, 3, 18
"""In cells: from corridor to corridor, and widths."""
QUESTIONS = 40


def building(side: int) -> NDArray[np.bool_]:
    """(side, side) free cells."""
    generator = np.random.default_rng(0)
    free = np.zeros((side, side), np.bool_)
    for top in range(0, side - BLOCK + 1, BLOCK):
        for left in range(0, side - BLOCK + 1, BLOCK):
            block = free[top : top + BLOCK, left : left + BLOCK]
            block[:CORRIDOR] = block[:, :CORRIDOR] = True
            rooms = block[CORRIDOR + WALL : -WALL, CORRIDOR + WALL : -WALL]
            half = rooms.shape[0] // 2
            rooms[:half, :half] = rooms[:half, half + WALL :] = True
            rooms[half + WALL :, :half] = rooms[half + WALL :, half + WALL :] = True
            at = generator.integers(5, half - DOOR - 5, 5)
            block[CORRIDOR : CORRIDOR + WALL, CORRIDOR + WALL :][:, at[0] : at[0] + DOOR] = True
            block[CORRIDOR + WALL :, CORRIDOR : CORRIDOR + WALL][at[1] : at[1] + DOOR] = True
            rooms[at[2] : at[2] + DOOR, half : half + WALL] = True
            rooms[half : half + WALL, half + WALL :][:, at[3] : at[3] + DOOR] = True
            rooms[half + WALL :, half : half + WALL][at[4] : at[4] + DOOR] = True
    free[[0, -1]] = free[:, [0, -1]] = False
    return free


def seconds(work: Callable[[], object]) -> float:
    """CPU seconds of some work."""
    begun = time.process_time()
    work()
    return time.process_time() - begun


@dataclass(frozen=True)
class Measured:
    """What is measured on one map: CPU seconds of each question."""

    regions: int
    ready: float
    graph: list[float]
    """The search over doorways in each quick question."""
    quick: list[float]
    exact: list[float]
    longer: list[float]
    """By how much the quick way is longer than the shortest, as a share."""
    flood: list[float]
    """What a breadth-first search over the cells of the regions on the way would take."""
    beside: list[float]
    """Dijkstra on the grid in scipy; of its own few questions."""


class TimedGraph:
    """Stands before a graph, and notes how long it takes to answer."""

    def __init__(self, graph: GateGraph) -> None:
        self.graph, self.steps = graph, graph.steps
        self.taken = 0.0

    def on_the_way(self, *question: Any, **settings: Any) -> Any:
        """See GateGraph."""
        found: list[Any] = []
        self.taken += seconds(lambda: found.append(self.graph.on_the_way(*question, **settings)))
        return found[0]


def pairs_of(free: NDArray[np.bool_], questions: int) -> list[list[list[int]]]:
    """(questions, 2) cells, of which a way leads from the first to the second."""
    generator, cells = np.random.default_rng(1), np.argwhere(free)
    piece = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    found: list[list[list[int]]] = []
    while len(found) < questions:
        start, goal = generator.choice(cells, 2).tolist()
        if piece[tuple(start)] == piece[tuple(goal)]:
            found.append([start, goal])
    return found


def measured(free: NDArray[np.bool_], questions: int) -> Measured:
    """Ask the same questions in each way; scipy gets the first two, and has to find the same lengths."""
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free, 0.05))
    begun = time.process_time()
    routes = Routes(regions)
    ready = time.process_time() - begun
    timed: Any = TimedGraph(routes.graph)
    routes.graph = timed
    pairs = pairs_of(regions.grid.free, questions)
    world = GridWorld(regions.grid.free, tuple(pairs[0][1]), 0.9)
    target = world.successor
    a_cell = seconds(lambda: world.steps_to_goal) / len(world)
    size = dict(zip(regions.region_names, (region.cells for region in regions.regions), strict=True))
    graph = csr_array(
        (np.ones(target.size), target.ravel().astype(np.int32), np.arange(0, target.size + 1, 4, np.int64)),
        shape=(len(world), len(world)),
    )
    found = Measured(len(regions.regions), ready, [], [], [], [], [], [])
    for number, (start, goal) in enumerate(pairs):
        ways: list[Route] = []
        timed.taken = 0.0
        found.quick.append(seconds(lambda: ways.append(routes.between(start, goal))))  # noqa: B023
        found.graph.append(timed.taken)
        found.exact.append(seconds(lambda: ways.append(routes.between(start, goal, exact=True))))  # noqa: B023
        found.longer.append(ways[0].steps / max(ways[1].steps, 1) - 1)
        found.flood.append(a_cell * sum(size[name] for name in set(ways[0].regions)))
        if number < 2:
            away: list[NDArray[np.float64]] = []
            state = int(world.state_of[tuple(goal)])
            found.beside.append(seconds(lambda: away.append(dijkstra(graph, indices=state))))  # noqa: B023
            assert away[0][world.state_of[tuple(start)]] == ways[1].steps, "exact is the shortest of all"
    return found


def rows(effort: Effort) -> Iterator[Row]:
    """Target 5's rows, on the largest map."""
    compile_all()
    side = SIDES[-1]
    found = measured(building(side), effort.rounds(QUESTIONS, 15))
    where = f"{side} x {side}, {found.regions} regions"
    mine, theirs = f"{1e3 * np.median(found.quick):.1f} CPU ms", float(np.median(found.beside))
    scipy = f"Dijkstra in scipy {1e3 * theirs:,.0f} CPU ms"
    yield Row(
        5, f"way between two places, {where}", mine, scipy,
        [theirs / took for took in found.quick], at_least(10),
    )  # fmt: skip
    yield Row(
        5, "the same, exact=True", f"{1e3 * np.median(found.exact):.1f} CPU ms", scipy,
        [theirs / took for took in found.exact],
    )  # fmt: skip
    yield Row(
        5, "the search over doorways in it", f"{1e3 * np.median(found.graph):.2f} CPU ms", "bound 1 ms",
        [took / 0.001 for took in found.graph], WITHIN_BOUND,
    )  # fmt: skip
    bound = [0.001 + flood for flood in found.flood]
    yield Row(
        5, "the same, beside search over its regions", mine,
        f"1 ms + breadth-first {1e3 * np.median(found.flood):.1f} ms",
        [took / most for took, most in zip(found.quick, bound, strict=True)], WITHIN_BOUND,
    )  # fmt: skip
    yield Row(
        5, "steps of the way, beside the shortest of all", f"mean {np.mean(found.longer):.2%} longer", "exact=True",
        [1 + longer for longer in found.longer], at_most(1.03, each=True),
    )  # fmt: skip


def line(name: str, free: NDArray[np.bool_]) -> str:
    """A line of the table."""
    found = measured(free, QUESTIONS)
    times = np.median(found.beside) / np.median(found.quick)
    return (
        f"{name:10s}{len(free):6d}{found.regions:9d}{found.ready:9.2f}"
        f"{1e3 * np.median(found.graph):8.2f} ({1e3 * max(found.graph):.2f}){1e3 * np.median(found.quick):10.1f}"
        f"{1e3 * np.median(found.exact):10.1f}{np.mean(found.longer):10.2%} ({max(found.longer):.2%})"
        f"{1e3 * np.median(found.beside):11.0f}{times:8.0f}"
    )


def compile_all() -> None:
    """Ask a question of a small map."""
    Routes(qualrl.segment(qualrl.OccupancyGrid.from_free(building(500), 0.05))).between([10, 10], [400, 400])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--largest", type=int, default=SIDES[-1], help="sides of larger buildings are left out")
    largest = parser.parse_args().largest
    compile_all()
    print(f"{'':10s}{'side':>6s}{'regions':>9s}{'ready s':>9s}{'graph ms':>15s}{'way ms':>10s}", end="")
    print(f"{'exact ms':>10s}{'longer':>18s}", end="")
    print(f"{'scipy ms':>11s}{'times':>8s}")
    for side in (side for side in SIDES if side <= largest):
        print(line("building", building(side)), flush=True)
    for side in (side for side in SIDES if side <= largest):
        print(line("plans", image(side) >= 250), flush=True)


if __name__ == "__main__":
    main()
