"""All targets in one table: ours beside C, textbook loops, peers and bounds.

    python -m tests.benchmarks                  all of it
    python -m tests.benchmarks --quick          fewer rounds, no map of more than 4000 x 4000 cells
    python -m tests.benchmarks --only 1,3       some targets

Targets: 1 Q-learning, 2 other learners, 3 exact values, 4 maps, 5 ways, 6 seeds over threads, 7 start-up, 8 memory.
Peers are installed once, each in an environment of its own.  A ratio is of one round, ours beside the other's; runs of
ours that take but milliseconds are repeated in it, and their median counts.  Loops in C, textbook loops and our own
learners take turns; peers run in processes of their own, after ours.  Loops are compiled before on both sides.
"beside": what ours is compared with; the ratio is how many times as fast ours is, or, beside a bound, what share of it
is used.  A verdict goes by the median ("each": by the worst); "-" has no target.  Leave the machine alone meanwhile:
other work shows in the ranges.
"""

import argparse
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

from tests.benchmarks import (
    against_c,
    exact_peers,
    exact_values,
    flat_peers,
    learning_speed,
    maps,
    memory,
    options_peer,
    routes,
    seeds,
    start_up,
    textbook,
)
from tests.benchmarks.effort import Effort
from tests.benchmarks.peers import Environments
from tests.benchmarks.table import HEADINGS, Row, line, summary

Part = Callable[[Effort], Iterator[Row]]
PARTS: dict[int, tuple[Part, ...]] = {
    1: (against_c.rows, textbook.rows, flat_peers.rows),
    2: (learning_speed.rows, options_peer.rows),
    3: (exact_values.rows, exact_peers.rows),
    4: (maps.rows,),
    5: (routes.rows,),
    6: (seeds.rows,),
    7: (start_up.rows,),
    8: (memory.rows,),
}


def all_rows(subjects: list[int], effort: Effort) -> Iterator[Row]:
    """The rows of some targets; a part that breaks off says so in a row of its own."""
    for subject in subjects:
        for part in PARTS[subject]:
            try:
                yield from part(effort)
            except Exception as error:
                yield Row(subject, part.__module__.rsplit(".", 1)[-1], missing=f"broke off: {told(error)}")


def told(error: Exception) -> str:
    """An error in a few words."""
    words = str(error).strip().splitlines() or [""]
    return f"{type(error).__name__}: {words[-1]}"[:100]


def machine() -> str:
    """What all this runs on."""
    info = Path("/proc/cpuinfo")
    names = [text.split(":")[1].strip() for text in info.read_text().splitlines() if text.startswith("model name")]
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numba", "numpy", "scipy"))
    processor = names[0] if names else platform.processor()
    return f"{processor}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}, {libraries}"


def subjects_of(text: str) -> list[int]:
    """The targets of an option such as 1,3."""
    chosen = [int(part) for part in text.split(",")]
    if unknown := set(chosen) - PARTS.keys():
        raise argparse.ArgumentTypeError(f"there are targets 1 to {max(PARTS)}, not {sorted(unknown)}")
    return chosen


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", type=subjects_of, default=list(PARTS), metavar="1,3", help="targets")
    parser.add_argument("--quick", action="store_true", help="fewer rounds")
    parser.add_argument("--peers", type=Path, default=Path(".venv-peers"), help="folder of the peers' environments")
    chosen = parser.parse_args()
    begun = time.perf_counter()
    print(f"{machine()}; python -m tests.benchmarks {' '.join(sys.argv[1:])}".rstrip())
    print(line(HEADINGS), flush=True)
    printed = []
    for row in all_rows(chosen.only, Effort(chosen.quick, Environments(chosen.peers.resolve()))):
        printed.append(row)
        print(line(row.cells), flush=True)
    wall, cpu = time.perf_counter() - begun, sum(os.times()[:4])
    print(f"{summary(printed)}; {wall / 60:.0f} minutes, {cpu / 60:.0f} of CPU, peers' installation included")


if __name__ == "__main__":
    main()
