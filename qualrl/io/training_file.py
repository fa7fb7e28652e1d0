"""Learning runs as one .npz file: what was learned, beside the model's own file."""

from pathlib import Path

from qualrl.errors import MapError, QualrlError
from qualrl.io.model_file import fingerprint, read_arrays, write_arrays
from qualrl.learning.run import LearningRun
from qualrl.learning.settings import LearnSettings
from qualrl.models.hybrid_mdp import HybridMDP

FORMAT = "qualrl-training/1"
ARRAYS = ("steps", "returns", "q", "arc_q", "arc_visits")
NOT_ALWAYS = ("shifted_q", "visits")


def write_run(run: LearningRun, file: Path) -> None:
    """Write a run, without its model."""
    about = {
        "format": FORMAT, "algorithm": run.algorithm, "seed": run.seed, "seconds": run.seconds,
        "settings": vars(run.settings),
        "model": fingerprint(run.model),
    }  # fmt: skip
    arrays = {name: getattr(run, name) for name in ARRAYS}
    arrays |= {name: array for name in NOT_ALWAYS if (array := getattr(run, name)) is not None}
    write_arrays(file, about, arrays)


def read_run(file: Path, model: HybridMDP) -> LearningRun:
    """Read a run of a model.  Raises MapError when the file is not one, or belongs to another model."""
    about, arrays = read_arrays(file, FORMAT)
    try:
        run = LearningRun(
            model=model, algorithm=about["algorithm"], seed=about["seed"], seconds=about["seconds"],
            settings=LearnSettings(**about["settings"]), steps=arrays["steps"], returns=arrays["returns"],
            q=arrays["q"], arc_q=arrays["arc_q"], arc_visits=arrays["arc_visits"],
            shifted_q=arrays.get("shifted_q"), visits=arrays.get("visits"),
        )  # fmt: skip
    except (KeyError, TypeError, QualrlError) as error:
        raise MapError(f"{file}: not a whole training file ({type(error).__name__}: {error})") from None
    if about["model"] != fingerprint(model) or run.q.shape != (len(model), model.world.n_actions if run.chooses else 1):
        raise MapError(f"{file}: holds values of another model; learn again")
    return run
