"""Peer libraries, each in an environment of its own, so that none decides which versions the others or we get.

A peer's script (``peer_scripts``) runs in a process of its own environment, gets its data in files, and prints one JSON
document.  Nothing of a peer is ever imported here.
"""

import json
import subprocess
import sys
import tempfile
import venv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.processes import ProcessError, run

SCRIPTS = Path(__file__).with_name("peer_scripts")
INSTALL_S, RUN_S = 900, 600
"""Longer is given up."""


class PeerError(Exception):
    """A peer that cannot be installed or does not run; says why in a few words."""


@dataclass(frozen=True)
class Peer:
    """What to install, and how."""

    name: str
    title: str
    installs: tuple[tuple[str, ...], ...]
    """Arguments of pip, one installation after the other."""


SIMPLE_OPTIONS = Peer("simpleoptions", "SimpleOptions", (("simpleoptions==0.11.0", "numpy"),))
OPEN_SPIEL = Peer("open_spiel", "OpenSpiel", (("open-spiel==2.0.2",),))
RLBERRY = Peer("rlberry", "rlberry", (("rlberry==0.7.3", "rlberry-scool==0.7.3"),))
MUSHROOM = Peer(
    "mushroom_rl",
    "MushroomRL",
    # It asks for one old release of each of these, with CUDA; its tabular part runs on newer ones.
    (
        ("torch==2.13.0", "gymnasium", "matplotlib", "opencv-python-headless", "pygame", "scikit-learn", "tqdm"),
        ("--no-deps", "mushroom-rl==1.10.2"),
    ),
)
JAX = Peer("jax", "JAX vmap", (("jax==0.10.2",),))
QUANTECON = Peer("quantecon", "QuantEcon", (("quantecon==0.11.4",),))
STORM = Peer("storm", "Storm", (("stormpy==2.0.0", "numpy"),))


class Environments:
    """The environments of peers, all in one folder; made when first asked for, used again the next time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._failed: dict[str, PeerError] = {}

    def run(self, peer: Peer, data: Mapping[str, Any], *, script: str | None = None) -> dict[str, Any]:
        """What a peer's script prints, as read from JSON.  Raises PeerError.

        data: arrays and numbers, which the script loads from the .npz file that its one argument names.
        """
        python = self._python(peer)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "data.npz"
            np.savez(file, **data)
            command = [str(python), str(SCRIPTS / f"with_{script or peer.name}.py"), str(file)]
            output = _run(command, RUN_S, f"{peer.title} failed")
        found: dict[str, Any] = json.loads(output.splitlines()[-1])
        return found

    def _python(self, peer: Peer) -> Path:
        """The interpreter of a peer's environment."""
        home = self.folder / peer.name
        installed, python = home / "installed.json", home / "bin" / "python"
        wanted = json.dumps(peer.installs)
        if installed.exists() and installed.read_text() == wanted:
            return python
        if peer.name in self._failed:
            raise self._failed[peer.name]
        print(f"(installing {peer.title} in {home})", file=sys.stderr, flush=True)
        try:
            venv.create(home, clear=True, with_pip=True)
            for arguments in peer.installs:
                pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *arguments]
                _run(pip, INSTALL_S, f"{peer.title} cannot be installed")
        except (PeerError, OSError, subprocess.CalledProcessError) as error:
            self._failed[peer.name] = PeerError(str(error))
            raise self._failed[peer.name] from None
        installed.write_text(wanted)
        return python


def _run(command: list[str], most_s: float, trouble: str) -> str:
    """What a command writes; raises PeerError."""
    try:
        return run(command, most_s=most_s).output
    except ProcessError as error:
        raise PeerError(f"{trouble}: {error}") from None
