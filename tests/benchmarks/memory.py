"""Memory: the most that a fresh process ever had, from a map to what was learned.

    python -m tests.benchmarks --only 8

The office is the bundled map of 600 x 400 cells.  The million states are those of a mosaic of floor plans (see
``maps``), learned for some episodes of limited length, as HQL on all of it would take long and no more memory.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2

from tests.benchmarks.effort import Effort
from tests.benchmarks.maps import image
from tests.benchmarks.processes import run_python
from tests.benchmarks.table import Row, bounded

OFFICE = """
import qualrl
model = qualrl.load_scenario("office").build()
run = qualrl.train(model, {learner!r}, episodes=20, epsilon=0.02)
"""
MILLION = """
import qualrl
regions = qualrl.segment(qualrl.read_map({file!r}))
largest = max(regions.regions, key=lambda region: region.cells)
model = qualrl.build(regions, largest.centre, gamma=0.999)
run = qualrl.train(model, {learner!r}, episodes=200, max_steps=10_000, epsilon=0.02)
"""
REPORT = """
from tests.benchmarks.processes import peak_mb
print(len(model), peak_mb())
"""
ROWS, COLUMNS = 1700, 1700
LEARNERS = "hql", "hql-replay"


def rows(effort: Effort) -> Iterator[Row]:
    """Target 8's rows."""
    del effort  # one run of each in any case
    for learner in LEARNERS:
        states, peak = measured(OFFICE.format(learner=learner))
        yield bounded(8, f"peak of {learner} on the office, {states:,} states", "MB", [peak], 200)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "map.png"
        cv2.imwrite(str(file), image(2000)[:ROWS, :COLUMNS])
        for learner in LEARNERS:
            states, peak = measured(MILLION.format(file=str(file), learner=learner))
            yield bounded(8, f"peak of {learner} on floor plans, {states:,} states", "MB", [peak], 600)


def measured(code: str) -> tuple[int, float]:
    """(states, peak in MiB) of a process that runs some code; before, once more, so that nothing is left to compile."""
    run_python(code)
    states, peak = run_python(code + REPORT).output.split()
    return int(states), float(peak)
