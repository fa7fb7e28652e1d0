"""How well two ways to divide the same cells agree."""

from math import comb

import numpy as np


def adjusted_rand_index(one, other):
    """Hubert and Arabie (1985), from the counts of pairs: 1 for the same division, about 0 for chance."""
    _, first = np.unique(one, return_inverse=True)
    _, second = np.unique(other, return_inverse=True)
    table = np.zeros((first.max() + 1, second.max() + 1), int)
    np.add.at(table, (first, second), 1)
    together = sum(comb(int(count), 2) for count in table.ravel())
    rows = sum(comb(int(count), 2) for count in table.sum(axis=1))
    columns = sum(comb(int(count), 2) for count in table.sum(axis=0))
    expected = rows * columns / comb(int(table.sum()), 2)
    most = (rows + columns) / 2
    return 1.0 if most == expected else (together - expected) / (most - expected)
