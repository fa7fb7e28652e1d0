"""Many runs over threads are the same runs one by one; one that fails stops the others."""

import gc
import time
import weakref
from threading import get_ident

import numpy as np
import pytest

import qualrl
from qualrl.errors import SettingError, UnknownNameError
from qualrl.learning.many import over_threads
from qualrl.models.once import once
from tests.worlds import PUZZLE, grid_of


@pytest.fixture(scope="module")
def puzzle() -> qualrl.HybridMDP:
    return qualrl.build(qualrl.segment(grid_of(PUZZLE)), [6, 6], start=[11, 1], gamma=0.9)


@pytest.mark.parametrize("algorithm", ["q-learning", "hql", "hql-replay", "option-q", "maxq-q"])
@pytest.mark.parametrize("threads", [1, 3])
def test_runs_over_threads_are_those_one_by_one(puzzle, algorithm, threads):
    seeds = [5, 0, 3, 4, 9, 1]
    together = qualrl.train_seeds(puzzle, seeds, algorithm, threads=threads, episodes=40, alpha="1/(1+k)**0.6")
    assert [run.seed for run in together] == seeds
    for run in together:
        alone = qualrl.train(puzzle, algorithm, seed=run.seed, episodes=40, alpha="1/(1+k)**0.6")
        np.testing.assert_array_equal(run.q, alone.q)
        np.testing.assert_array_equal(run.steps, alone.steps)
        assert run.plan().explain() == alone.plan().explain()


def test_a_number_of_seeds_counts_from_0_and_is_told_of(puzzle):
    told: list[int] = []
    runs = qualrl.train_seeds(puzzle, 3, "q-learning", told=told.append, episodes=2)
    assert [run.seed for run in runs] == [0, 1, 2]
    assert told == [1, 2, 3]


def test_what_train_refuses_train_seeds_refuses(puzzle):
    with pytest.raises(UnknownNameError, match="alhpa"):
        qualrl.train_seeds(puzzle, 2, alhpa=1)
    with pytest.raises(SettingError, match="seed"):
        qualrl.train_seeds(puzzle, [1, -1], episodes=1)
    with pytest.raises(SettingError, match="threads must be at least 1, got 0"):
        qualrl.train_seeds(puzzle, 2, threads=0, episodes=1)
    assert qualrl.train_seeds(puzzle, []) == qualrl.train_seeds(puzzle, 0) == []
    with pytest.raises(TypeError, match="train_seeds needs a HybridMDP"):
        qualrl.train_seeds("puzzle", 2)


def test_a_run_that_fails_stops_the_others(puzzle):
    def one(seed, stops):
        if seed == 1:
            raise ValueError("seed 1")
        qualrl.train(puzzle, "q-learning", seed=seed, watch=stops, episodes=10_000_000)

    begun = time.monotonic()
    with pytest.raises(ValueError, match="seed 1"):
        over_threads(one, range(20), threads=2)
    assert time.monotonic() - begun < 10


def test_ctrl_c_stops_the_others(puzzle):
    def one(seed, stops):
        qualrl.train(puzzle, "q-learning", seed=seed, watch=stops, episodes=10_000_000 if seed else 1)

    def told(_):
        raise KeyboardInterrupt

    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        over_threads(one, range(20), threads=2, told=told)
    assert time.monotonic() - begun < 10


def test_only_runs_that_take_long_get_more_than_one_thread():
    def one(seconds, _):
        until = time.thread_time() + seconds
        while time.thread_time() < until:
            pass
        return get_ident()

    assert len(set(over_threads(one, [0.0] * 300, threads=2))) == 1
    assert len(set(over_threads(one, [0.05] * 8, threads=2))) == 2


def test_what_depends_on_the_model_is_made_once_and_goes_with_it():
    made = []

    @once
    def slowly(model, number):
        made.append(number)
        time.sleep(0.05)
        if number == 13:
            raise ValueError("13")
        return [number]

    model = qualrl.build(qualrl.segment(grid_of(PUZZLE)), [6, 6])
    found = over_threads(lambda number, _: slowly(model, number), [1, 2, 1, 1, 2, 1], threads=3)
    assert found == [[1], [2], [1], [1], [2], [1]]
    assert sorted(made) == [1, 2]
    assert found[0] is found[2]
    for _ in range(2):
        with pytest.raises(ValueError, match="13"):
            slowly(model, 13)
    assert made.count(13) == 2
    result, model = weakref.ref(model), None
    gc.collect()
    assert result() is None
