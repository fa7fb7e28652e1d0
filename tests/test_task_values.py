"""What MAXQ-Q keeps of the worth of tasks, against the textbook on random task graphs, to the last bit."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.models.task_graph import Task, TaskGraph
from tests.hierarchical_worlds import FALLING, TextbookMaxq, compare_maxq, model_of, tasks_by_hand, tasks_of
from tests.learning_worlds import table_model

MOVES = 3


def random_world(chance, n_states, gamma):
    """A table most of whose moves pay nothing, so that a state's completions change while its moves' worth does not."""

    def outcomes(s):
        targets = np.unique(chance.integers(0, n_states, chance.integers(1, 3)))
        paid = chance.choice([0.0, 0.0, 0.0, -1.0, 2.0], len(targets))
        return [(1 / len(targets), t, r, t == n_states - 1) for t, r in zip(targets.tolist(), paid, strict=True)]

    rows = {s: {a: outcomes(s) for a in range(MOVES)} for s in range(n_states)}
    rows[0][0] = [(0.2, n_states - 1, 1.0, True), (0.8, 1, 0.0, False)]  # some way leads to the end
    return TabularMDP.from_outcomes(rows, gamma)


def random_tasks(chance, world, told):
    """Tasks, each of which calls some of those after it and some moves; ``told`` are paid for where they end."""
    names, moves, tasks = [f"task {i}" for i in range(chance.integers(2, 6))], list(world.action_names), []
    for i, name in enumerate(names):
        calls = moves
        if i < len(names) - 1 and chance.random() < 0.8:
            others = [*names[i + 2 :], *moves]
            calls = chance.permutation([names[i + 1], *others[: chance.integers(len(others) + 1)]]).tolist()
        some = [chance.choice(len(world), chance.integers(0, 1 + len(world) // 2)).tolist() for _ in calls]
        only = {call: states for call, states in zip(calls, some, strict=True) if chance.random() < 0.1}
        ends = chance.choice(len(world), chance.integers(0, 1 + len(world) // 3)).tolist()
        pseudo = {int(s): float(chance.normal()) for s in ends[:2]} if told else {}
        tasks.append(Task(name, tuple(calls), ends, only, pseudo))
    return [Task("root", (*names, *moves)), *tasks]


@st.composite
def graphs_by_hand(draw):
    """(model, its tasks for the textbook)."""
    chance = np.random.default_rng(draw(st.integers(0, 2**32)))
    world = random_world(chance, draw(st.integers(3, 9)), draw(st.sampled_from([0.5, 0.9])))
    tasks = random_tasks(chance, world, draw(st.booleans()))
    model = table_model(world)
    return replace(model, tasks=TaskGraph.from_tasks(tasks, world)), tasks_by_hand(tasks, world)


@st.composite
def graphs_of_landmarks(draw):
    """(model, its tasks for the textbook, whether single moves are offered everywhere), on random grids."""
    chance = np.random.default_rng(draw(st.integers(0, 2**32)))
    free = chance.random(chance.integers(3, 6, 2)) < 0.85
    free[0, :2] = True
    cells = [tuple(cell) for cell in chance.permutation(np.argwhere(free)).tolist()]
    marks = {cell: [(0,), (1,), (0, 1)][chance.integers(3)] for cell in cells[: draw(st.integers(0, 5))]}
    model = model_of(free, (0, 0), marks, slip=0.3, prize=draw(st.sampled_from([100.0, -1.0])))
    primitives = draw(st.booleans())
    return model, tasks_of(model, primitives), primitives


def kept(learner):
    """(task, state, V) of every task whose worth in a state is taken to be known."""
    start, order = learner.graph.bottom_up
    for s, kind in enumerate(learner.graph.kind_of):
        low = learner.graph.value_first[s] + learner.graph.n_actions
        if not learner._kept.stale[s]:
            for place, task in enumerate(order[start[kind] : start[kind + 1]].tolist()):
                yield task, s, learner._kept.value[low + place]


def check_kept(learner, told):
    """V that is kept is V of the completions as they are now."""
    told.take(learner)
    found = 0
    for task, s, value in kept(learner):
        found += 1
        open_here = told.twin.open(told.names[task], s)
        assert value == (told.twin.value(told.names[task], s) if open_here else -np.inf)
    return found


def run_in_slices(model, tasks, chosen, seed, sizes):
    learner, told = start_learner(model, "maxq-q", chosen, seed), TextbookMaxq(model, chosen, tasks)
    for size in sizes:
        learner.advance(size)
        check_kept(learner, told)
    learner._poll()
    assert check_kept(learner, told) == (np.diff(learner.graph.bottom_up[0])[learner.graph.kind_of]).sum()


SIZES = st.lists(st.integers(1, 40), min_size=1, max_size=12)
SETTINGS = st.builds(
    LearnSettings, episodes=st.integers(1, 30), alpha=st.just(0.2),
    epsilon=st.sampled_from([0.0, 0.1, 0.6]), max_steps=st.integers(1, 60),
)  # fmt: skip
FALLING_TOO = st.builds(replace, SETTINGS, alpha=st.sampled_from([0.2, FALLING]))


@settings(deadline=None)
@given(graphs_by_hand(), FALLING_TOO, st.integers(0, 2**32), SIZES)
def test_on_tasks_by_hand_what_is_kept_is_what_completions_say(case, chosen, seed, sizes):
    run_in_slices(*case, chosen, seed, sizes)


@settings(deadline=None)
@given(graphs_of_landmarks(), SETTINGS, st.integers(0, 2**32), SIZES)
def test_on_landmarks_what_is_kept_is_what_completions_say(case, chosen, seed, sizes):
    model, tasks, primitives = case
    run_in_slices(model, tasks, replace(chosen, primitives=primitives), seed, sizes)


@settings(deadline=None)
@given(graphs_by_hand(), FALLING_TOO, st.integers(0, 2**32))
def test_on_tasks_by_hand_trajectories_and_completions_are_the_textbooks(case, chosen, seed):
    compare_maxq(*case, chosen, seed)


@settings(deadline=None)
@given(graphs_of_landmarks(), SETTINGS, st.integers(0, 2**32))
def test_on_landmarks_trajectories_and_completions_are_the_textbooks(case, chosen, seed):
    model, tasks, primitives = case
    compare_maxq(model, tasks, replace(chosen, primitives=primitives), seed)
