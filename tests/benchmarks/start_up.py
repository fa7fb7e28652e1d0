"""Start-up: CPU seconds of fresh processes, with compiled loops at hand and without.

    python -m tests.benchmarks --only 7

"Warm": all that is needed lies in numba's cache.  "Cold": the cache is an empty folder; one learner is compiled, on a
model read from a file, so that finding regions has no part in it.  All threads and processes count.
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from qualrl.io.model_file import write_model
from qualrl.learning.rules import RULES
from tests.benchmarks.against_c import puzzle
from tests.benchmarks.effort import Effort
from tests.benchmarks.processes import run, run_python
from tests.benchmarks.table import Row, at_most, bounded, short

FEW = "q-learning", "hql", "hql-replay", "maxq-q"
MODEL_FROM_FILE = """
from pathlib import Path
import qualrl
from qualrl.io.model_file import read_model
qualrl.train(read_model(Path({file!r})), {learner!r}, episodes=10)
"""
MODEL_FROM_MAP = """
import qualrl
qualrl.train(qualrl.load_scenario("puzzle").build(), {learner!r}, episodes=10)
"""
COLD_S, WARM_S, LIGHT_S = 3.0, 1.2, 0.15


def rows(effort: Effort) -> Iterator[Row]:
    """Target 7's rows."""
    rounds = effort.rounds(9, 5)
    command = [str(Path(sys.executable).with_name("qualrl")), "--help"]
    run(command)  # writes byte code
    yield bounded(7, "qualrl --help", "CPU s", [run(command).cpu_s for _ in range(rounds)], LIGHT_S)
    yield bounded(7, "import qualrl", "CPU s", [run_python("import qualrl").cpu_s for _ in range(rounds)], LIGHT_S)
    for learner in ("q-learning", "hql-replay"):
        code = MODEL_FROM_MAP.format(learner=learner)
        run_python(code)  # compile
        found = [run_python(code).cpu_s for _ in range(rounds)]
        yield bounded(7, f"map, model and 10 episodes of {learner}, warm", "CPU s", found, WARM_S)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.npz"
        write_model(puzzle(), file)
        learners = FEW if effort.quick else tuple(RULES)
        times = {learner: cold(MODEL_FROM_FILE.format(file=str(file), learner=learner)) for learner in learners}
    for learner in FEW:
        yield bounded(7, f"{learner} alone, cold", "CPU s", [times[learner]], COLD_S)
    slowest = max(times, key=times.__getitem__)
    yield Row(
        7, f"each of {len(times)} learners alone, cold", f"{slowest} {short(times[slowest])} CPU s",
        f"bound {COLD_S:g} CPU s", [seconds / COLD_S for seconds in times.values()], at_most(1, each=True),
    )  # fmt: skip


def cold(code: str) -> float:
    """CPU seconds of some Python code that finds no compiled loop."""
    with tempfile.TemporaryDirectory() as cache:
        return run_python(code, {"NUMBA_CACHE_DIR": cache}).cpu_s
