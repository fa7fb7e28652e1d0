"""qualrl: from an occupancy map to a hybrid MDP and an explained plan.

    import qualrl
    regions = qualrl.segment(qualrl.read_map("maps/office.yaml"))
    model = qualrl.build(regions, goal="room C", gamma=0.999)
    print(qualrl.plan(model, start="room A").explain())

Importing the package is light: each name loads what it needs when it is first used.
"""

import importlib
import os
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

# The threads of OpenBLAS, which NumPy and OpenCV each bring along, keep a core busy when they are loaded and after each
# product, lest there is more to do: a sixth of a second where there is not.  2^20 ticks, half a millisecond, are left
# to who multiplies matrices.
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "20")

if TYPE_CHECKING:
    from qualrl import questions
    from qualrl.api import Training, build, check, plan, train, train_seeds
    from qualrl.errors import QualrlError
    from qualrl.io.read_map import read_map
    from qualrl.io.scenario import Scenario, load_scenario
    from qualrl.models.grid_world import GridWorld
    from qualrl.models.hybrid_mdp import HybridMDP
    from qualrl.models.tabular_mdp import TabularMDP
    from qualrl.planning.plan import Plan
    from qualrl.planning.routes import Routes
    from qualrl.spatial.occupancy_grid import OccupancyGrid
    from qualrl.spatial.region_map import RegionMap
    from qualrl.spatial.segmentation import segment

_HOME = {
    "Training": "api",
    "build": "api",
    "check": "api",
    "plan": "api",
    "train": "api",
    "train_seeds": "api",
    "QualrlError": "errors",
    "read_map": "io.read_map",
    "Scenario": "io.scenario",
    "load_scenario": "io.scenario",
    "GridWorld": "models.grid_world",
    "HybridMDP": "models.hybrid_mdp",
    "TabularMDP": "models.tabular_mdp",
    "Plan": "planning.plan",
    "Routes": "planning.routes",
    "OccupancyGrid": "spatial.occupancy_grid",
    "RegionMap": "spatial.region_map",
    "segment": "spatial.segmentation",
}

__all__ = [
    "GridWorld",
    "HybridMDP",
    "OccupancyGrid",
    "Plan",
    "QualrlError",
    "RegionMap",
    "Routes",
    "Scenario",
    "TabularMDP",
    "Training",
    "__version__",
    "build",
    "check",
    "load_scenario",
    "plan",
    "questions",
    "read_map",
    "segment",
    "train",
    "train_seeds",
]


def __getattr__(name: str) -> Any:
    if name != "questions" and name not in _HOME:
        raise AttributeError(f"module 'qualrl' has no attribute {name!r}")
    from qualrl.garbage import left_alone

    with left_alone(kept=True):
        home = importlib.import_module(f"qualrl.{_HOME.get(name, name)}")
    value = home if name == "questions" else getattr(home, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
