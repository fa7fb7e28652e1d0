"""Boosted decision trees, asked one row of features at a time.

Not walked from node to node, whose order nobody can foretell: a feature's tests are met from the smallest threshold
on, each that fails takes away the leaves of its left side, and at the end the first leaf left is the tree's answer
(Lucchese, Nardini, Orlando, Perego, Tonellotto and Venturini, "QuickScorer", 2015).

T: trees.  L: leaves.  Q: tests, the nodes that are no leaves.  N: rows.  F: features.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qualrl.kernels.instructions import trailing_zeros
from qualrl.kernels.jit import compiled, compiled_part

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Words = NDArray[np.uint64]

MOST_LEAVES = 64
"""Of a tree: a bit of a word each."""
MOST_TREES = 2**16
ALL_LEAVES = np.uint64(2**64 - 1)


class Trees(NamedTuple):
    """Boosted trees: the sum of their leaves is the logarithm of the odds.  Nodes of all trees in one row."""

    root: Ints
    """(T,) first node of each tree."""
    feature: Ints
    """(nodes,) -1 in leaves."""
    threshold: NDArray[np.float32]
    """(nodes,) a value up to it goes on to the node's left, else right."""
    left: Ints
    right: Ints
    leaf: NDArray[np.float32]
    """(nodes,) what a leaf adds."""
    start: float
    """What the sum starts from."""


class Questions(NamedTuple):
    """The same trees, by the features that they test."""

    first: Ints
    """(F + 1,) where the tests of each feature begin, and the number of all."""
    threshold: NDArray[np.float32]
    """(Q,) ascending for each feature: a value above it fails."""
    tree: NDArray[np.uint16]
    """(Q,)"""
    left_over: Words
    """(Q,) the tree's leaves, from the left a bit each, that a failed test leaves."""
    leaf: NDArray[np.float32]
    """(L,) what each leaf adds, by tree and from the left."""
    first_leaf: Ints
    """(T,) the number of each tree's leftmost leaf."""
    start: float


def questions_of(trees: Trees) -> Questions:
    """The tests of the trees, which must not be more or have more leaves than is provided for."""
    levels = [np.asarray(trees.root)]
    while levels[-1].size:
        inner = levels[-1][trees.feature[levels[-1]] >= 0]
        levels.append(np.concatenate([trees.left[inner], trees.right[inner]]))
    is_leaf = trees.feature < 0
    leaves = is_leaf.astype(np.int64)
    for level in reversed(levels):
        inner = level[~is_leaf[level]]
        leaves[inner] = leaves[trees.left[inner]] + leaves[trees.right[inner]]
    if leaves.max(initial=0) > MOST_LEAVES or len(trees.root) > MOST_TREES:
        raise ValueError(f"{len(trees.root)} trees of up to {leaves.max(initial=0)} leaves: more than are provided for")
    tree, before = np.zeros(is_leaf.size, np.int32), np.zeros(is_leaf.size, np.int64)
    tree[trees.root] = np.arange(len(trees.root))
    for level in levels:
        inner = level[~is_leaf[level]]
        for side in (trees.left, trees.right):
            tree[side[inner]] = tree[inner]
        before[trees.left[inner]] = before[inner]
        before[trees.right[inner]] = before[inner] + leaves[trees.left[inner]]
    test = np.flatnonzero(~is_leaf)
    test = test[np.lexsort((test, trees.threshold[test], trees.feature[test]))]
    features = int(trees.feature.max(initial=0)) + 1
    on_left = trees.left[test]
    taken = (np.uint64(1) << leaves[on_left].astype(np.uint64)) - np.uint64(1) << before[on_left].astype(np.uint64)
    first_leaf = np.cumsum(leaves[trees.root]) - leaves[trees.root]
    leaf = np.empty(is_leaf.sum(), np.float32)
    leaf[first_leaf[tree[is_leaf]] + before[is_leaf]] = trees.leaf[is_leaf]
    return Questions(
        np.searchsorted(trees.feature[test], np.arange(features + 1)).astype(np.int32), trees.threshold[test],
        tree[test].astype(np.uint16), ~taken, leaf, first_leaf.astype(np.int32), trees.start,
    )  # fmt: skip


@compiled
def odds_of(questions: Questions, features: Floats) -> Floats:
    """(N,) logarithm of the odds that the trees give to rows (N, F) of features."""
    found = np.empty(len(features))
    left_over = np.empty(len(questions.first_leaf), np.uint64)
    for row in range(len(features)):
        left_over[:] = ALL_LEAVES
        for feature in range(features.shape[1]):
            take_away(questions, feature, features[row, feature], left_over)
        found[row] = odds(questions, left_over)
    return found


@compiled_part
def take_away(questions: Questions, feature: int, value: float, left_over: Words) -> None:
    """Take away the leaves (T,) to which no tree comes where a feature has that value."""
    if feature >= len(questions.first) - 1:
        return  # no tree asks for it
    first = questions.first[feature]
    for test in range(first, _passed(questions, value, first, questions.first[feature + 1])):
        left_over[questions.tree[np.uint64(test)]] &= questions.left_over[np.uint64(test)]


@compiled_part
def odds(questions: Questions, left_over: Words) -> float:
    """The logarithm of the odds, when all features took away their leaves."""
    total = questions.start
    for tree in range(len(left_over)):
        total += questions.leaf[np.uint64(questions.first_leaf[tree]) + np.uint64(trailing_zeros(left_over[tree]))]
    return total


@compiled_part
def _passed(questions: Questions, value: float, first: int, end: int) -> int:
    """The first of the tests, from first to before the end, that a value passes; the end if none."""
    while first < end:
        middle = (first + end) // 2
        if value <= questions.threshold[middle]:
            end = middle
        else:
            first = middle + 1
    return first
