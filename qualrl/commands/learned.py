"""What a result folder holds of a model and of what was learned."""

from pathlib import Path

from qualrl import api
from qualrl.errors import ScenarioError
from qualrl.io.model_file import read_model
from qualrl.io.training_file import read_run
from qualrl.models.hybrid_mdp import HybridMDP

MODEL_FILE, TRAINING_FILE = "hybrid_mdp.npz", "training.npz"


def model_in(folder: Path) -> HybridMDP:
    """The model of a result folder.  Raises ScenarioError where there is none, MapError for a file of another sort."""
    if not (folder / MODEL_FILE).is_file():
        raise ScenarioError(f"{folder}: holds no {MODEL_FILE}; name a scenario, or a folder that qualrl wrote")
    return read_model(folder / MODEL_FILE)


def training_in(folder: Path, model: HybridMDP) -> api.Training:
    """What was learned of its model; the same errors."""
    if not (folder / TRAINING_FILE).is_file():
        raise ScenarioError(f"{folder}: holds no {TRAINING_FILE}, so nothing was learned there; 'qualrl learn' does")
    return api.training_of(read_run(folder / TRAINING_FILE, model))
