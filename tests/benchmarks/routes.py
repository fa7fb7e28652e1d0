"""Ways across large buildings: seconds a question, beside Dijkstra on the grid in scipy.

    python -m tests.benchmarks.routes [--largest 4000]

"building": blocks of four rooms each along a grid of corridors, 0.05 m a cell, doors where chance puts them.  "plans":
the generated floor plans of ``tests.benchmarks.maps``, which nothing connects to each other, so ways are short.
Questions: random pairs of cells between which a way leads.  "graph": the part of it that is a search over doorways,
median (largest).  "exact": the shortest way of all.  Longer: how much longer the quick way is, mean (largest).  Wall
milliseconds of one thread, medians; scipy: of two questions.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

import qualrl
from qualrl.models.grid_world import GridWorld
from qualrl.planning.gate_graph import GateGraph
from qualrl.planning.routes import Routes
from tests.benchmarks.maps import image

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
    """Wall seconds of some work."""
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


class TimedGraph:
    """Stands before a graph, and notes how long it takes to answer."""

    def __init__(self, graph: GateGraph) -> None:
        self.graph = graph
        self.taken: list[float] = []

    def on_the_way(self, *question: Any) -> Any:
        """See GateGraph."""
        found: list[Any] = []
        self.taken.append(seconds(lambda: found.append(self.graph.on_the_way(*question))))
        return found[0]


def questions(free: NDArray[np.bool_]) -> list[list[list[int]]]:
    """(QUESTIONS, 2) cells, of which a way leads from the first to the second."""
    generator, cells = np.random.default_rng(1), np.argwhere(free)
    piece = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    found: list[list[list[int]]] = []
    while len(found) < QUESTIONS:
        start, goal = generator.choice(cells, 2).tolist()
        if piece[tuple(start)] == piece[tuple(goal)]:
            found.append([start, goal])
    return found


def row(name: str, free: NDArray[np.bool_]) -> str:
    """A line of the table."""
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free, 0.05))
    begun = time.perf_counter()
    routes = Routes(regions)
    ready = time.perf_counter() - begun
    timed: Any = TimedGraph(routes.graph)
    routes.graph = timed
    pairs = questions(regions.grid.free)
    quick, whole, longer = [], [], []
    for start, goal in pairs:
        found: list[int] = []
        quick.append(seconds(lambda: found.append(routes.between(start, goal).steps)))  # noqa: B023
        whole.append(seconds(lambda: found.append(routes.between(start, goal, exact=True).steps)))  # noqa: B023
        longer.append(found[0] / max(found[1], 1) - 1)
    world = GridWorld(regions.grid.free, tuple(pairs[0][1]), 0.9)
    target = world.successor
    graph = csr_array(
        (np.ones(target.size), target.ravel().astype(np.int32), np.arange(0, target.size + 1, 4, np.int64)),
        shape=(len(world), len(world)),
    )
    beside = [
        seconds(lambda: dijkstra(graph, indices=int(world.state_of[tuple(goal)])))  # noqa: B023
        for _, goal in pairs[:2]
    ]
    times = np.median(beside) / np.median(quick)
    return (
        f"{name:10s}{len(free):6d}{len(regions.regions):9d}{ready:9.2f}"
        f"{1e3 * np.median(timed.taken):8.2f} ({1e3 * max(timed.taken):.2f})"
        f"{1e3 * np.median(quick):10.1f}{1e3 * np.median(whole):10.1f}"
        f"{np.mean(longer):10.2%} ({max(longer):.2%}){1e3 * np.median(beside):11.0f}{times:8.0f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--largest", type=int, default=SIDES[-1], help="sides of larger buildings are left out")
    largest = parser.parse_args().largest
    small = Routes(qualrl.segment(qualrl.OccupancyGrid.from_free(building(500), 0.05)))
    small.between([10, 10], [400, 400])  # compile
    print(f"{'':10s}{'side':>6s}{'regions':>9s}{'ready s':>9s}{'graph ms':>15s}{'way ms':>10s}", end="")
    print(f"{'exact ms':>10s}{'longer':>18s}", end="")
    print(f"{'scipy ms':>11s}{'times':>8s}")
    for side in (side for side in SIDES if side <= largest):
        print(row("building", building(side)), flush=True)
    for side in (side for side in SIDES if side <= largest):
        print(row("plans", image(side) >= 250), flush=True)


if __name__ == "__main__":
    main()
