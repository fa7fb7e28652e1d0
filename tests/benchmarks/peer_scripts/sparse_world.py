"""The sparse table of a slippery world, as it is handed over: row ``A s + a`` has where action a of state s leads."""

import numpy as np
from peer_data import load

data = load()
n_actions, gamma, error = data["n_actions"], data["gamma"], data["error"]
probability, target, row_start = data["probability"], data["target"], data["row_start"]
reward = data["reward"]
"""(S A,) expected."""
n_states = len(reward) // n_actions


def save(values: np.ndarray) -> None:
    """Put the values where they are asked for."""
    np.save(data["values_in"], values)
