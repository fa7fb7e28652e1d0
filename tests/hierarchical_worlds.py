"""Worlds for the hierarchical learners, and what their twins want to know of them."""

import numpy as np
import pytest

from qualrl.learning.hierarchical import worst_return
from qualrl.learning.trainer import start_learner
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.landmarks import landmark_level
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.qualitative.graph import graph_of_mapping
from tests import oracles
from tests import oracles_tasks as twins
from tests.worlds import grid_of

LANDMARK_LEARNERS = ["option-q", "intra-option-q", "hamq", "switch", "w-learning"]


LEARNERS = [*LANDMARK_LEARNERS, "maxq-q"]


FALLING = "4/(8+k)"


RATES = {0.2: lambda k: 0.2, FALLING: lambda k: 4 / (8 + k)}
"""What alpha_k is, written anew."""


HALVES = """
#########
#...#...#
#.......#
#...#...#
#...#...#
#.......#
#########
"""


def model_of(text_or_free, goal, marks, slip=0.0, start=None, directions=4, prize=100.0, region_of=None):
    """Two regions (or as given): marks are {cell: regions it lies in or joins}; the goal is a landmark by itself."""
    free = grid_of(text_or_free).free if isinstance(text_or_free, str) else text_or_free
    world = GridWorld(free, goal, 0.9, slip, directions, goal_reward=prize)
    region_of = region_of or (lambda cell: int(cell[1] >= free.shape[1] // 2))
    regions = np.array([region_of(cell) for cell in world.cells.tolist()], np.int32)
    landmark_of = np.full(len(world), -1, np.int32)
    marks = {cell: joined for cell, joined in marks.items() if cell != goal}
    for index, cell in enumerate([*marks, goal]):
        landmark_of[world.state_of[cell]] = index
    joined = [*marks.values(), (int(regions[world.goal]),)]
    level = landmark_level([*map(str, marks), "goal"], landmark_of, joined)
    start_state = None if start is None else int(world.state_of[start])
    graph = graph_of_mapping(("west", "east"), [(0, 1), (1, 0)])
    return HybridMDP(world, ("west", "east"), regions, level, graph, start_state)


def halves(slip=0.0, start=None, directions=4):
    marks = {(2, 4): (0, 1), (5, 4): (0, 1), (1, 1): (0,), (5, 6): (1,)}
    return model_of(HALVES, (1, 7), marks, slip, start, directions)


def table_model(slip=0.2):
    world = halves(slip).grid
    names = ["left" if c < 4 else "right" for _, c in world.cells.tolist()]
    return HybridMDP.from_table(world.table(), names, start=3)


def stepper(model):
    """(step of the twin, likely, terminal) of a model."""
    world = model.world
    if isinstance(world, TabularMDP):

        def step(s, a, draws):
            x, row = (next(draws) >> 11) / 2**53, s * world.n_actions + a
            entries = range(world.row_start[row], world.row_start[row + 1])
            entry = next((e for e in entries if x < world.cumulative[e]), entries[-1])
            return int(world.target[entry]), float(world.reward[entry])

        return step, twins.likely_of(world), lambda s: bool(world.terminal[s])
    grid = oracles.GridTwin(world.free, world.goal_cell, world.directions, world.slip, prize=world.goal_reward)
    moves, index = len(grid.moves), {cell: i for i, cell in enumerate(grid.cells)}
    likely = [[index[grid.lands(cell, move)] for move in range(moves)] for cell in grid.cells]

    def step(s, a, draws):
        if world.slip and (x := (next(draws) >> 11) / 2**53) < world.slip:
            a = (a + 1 + min(int(x / world.slip * (moves - 1)), moves - 2)) % moves
        to = likely[s][a]
        cost = world.step_reward * float(np.hypot(*grid.moves[a]))
        return to, world.goal_reward if grid.cells[to] == grid.goal else cost

    return step, likely, lambda s: grid.cells[s] == grid.goal


def dense(model):
    """(chance, expected reward) of a model, for exact values."""
    world = model.world
    if isinstance(world, TabularMDP):

        def outcomes(s, a):
            row = s * world.n_actions + a
            entries = range(world.row_start[row], world.row_start[row + 1])
            return [(world.probability[e], world.target[e], world.reward[e]) for e in entries]

    else:
        grid = oracles.GridTwin(world.free, world.goal_cell, world.directions, world.slip, prize=world.goal_reward)
        index = {cell: i for i, cell in enumerate(grid.cells)}

        def outcomes(s, a):
            return [(p, index[cell], reward) for p, cell, reward in grid.outcomes(grid.cells[s], a)]

    return twins.dense(outcomes, len(world), world.n_actions)


def top_values(learner, marks, s):
    """{choice: value} of a state, as the learner has them."""
    options = [o for o in marks.options if o[0] in marks.regions_of[s]]
    row = learner.q[learner.first[s] : learner.first[s + 1]]
    values = dict(zip([*options, *range(len(marks.likely[0]))], row.tolist(), strict=False))
    return {choice: value for choice, value in values.items() if value > -np.inf}


def inner_values(learner, marks, s, option):
    """{move: value} of an option, task or sub-agent in a state."""
    options, moves = [o for o in marks.options if o[0] in marks.regions_of[s]], len(marks.likely[0])
    low = learner.first[s] + len(options) + moves * (1 + options.index(option))
    return {a: float(v) for a, v in enumerate(learner.q[low : low + moves]) if v > -np.inf}


def finished(learner, slice_steps=10**7):
    while learner.advance(slice_steps) == slice_steps:
        pass
    return learner


def same(found, wanted):
    assert found.keys() == wanted.keys()
    assert list(found.values()) == pytest.approx(list(wanted.values()), rel=1e-12, abs=1e-12)


def tasks_of(model, primitives):
    """The tasks between the landmarks of a model, for the textbook."""
    _, likely, terminal = stepper(model)
    marks = twins.Landmarks(model, likely, terminal)
    found, moves = marks.choices(primitives), range(len(likely[0]))
    failing = worst_return(model) - max(model.world.reward_bounds[1], 0.0)
    tasks = {"root": {"calls": [*marks.options, *moves], "may": lambda c, s: c in found[s], "pseudo": lambda s: 0.0}}
    for option in marks.options:
        tasks[option] = {
            "calls": list(moves),
            "may": lambda c, s, option=option: marks.may(option, s),
            "pseudo": lambda s, o=option: 0.0 if terminal(s) or marks.mark_of[s] == o[1] else failing,
        }
    return tasks


def tasks_by_hand(tasks, world):
    """The same for tasks written by hand."""
    by_name, moves = {task.name: task for task in tasks}, list(world.action_names)

    def may(task, call, s):
        if world.terminal[s] or s in task.ends or s not in task.only.get(call, range(len(world))):
            return False
        return call not in by_name or any(may(by_name[call], below, s) for below in by_name[call].calls)

    return {
        task.name: {
            "calls": [moves.index(call) if call in moves else call for call in task.calls],
            "may": lambda c, s, task=task: may(task, moves[c] if isinstance(c, int) else c, s),
            "pseudo": lambda s, task=task: task.pseudo.get(s, 0.0),
        }
        for task in tasks
    }


def detour_model(start=(4, 1)):
    """Two regions side by side in one open room; the only landmark between them lies in the top row."""
    return model_of(np.ones((6, 6), bool), (5, 5), {(0, 3): (0, 1)}, start=start)


def best_of(values, n_states):
    """(S,) the largest of {(s, choice): value}; 0 where there is nothing to choose."""
    best = [0.0] * n_states
    for s in {s for s, _ in values}:
        best[s] = float(max(value for (at, _), value in values.items() if at == s))
    return best


class TextbookMaxq:
    """The textbook learner of a model, and how the two tell each other what they hold."""

    def __init__(self, model, chosen, tasks):
        self.step, likely, self.terminal = stepper(model)
        self.names, self.starts, self.chosen = list(tasks), model.starts.tolist(), chosen
        rate = RATES[chosen.alpha]
        self.twin = twins.Maxq(tasks, len(likely), len(likely[0]), gamma=model.gamma, rate=rate, epsilon=chosen.epsilon)

    def learn(self, seed):
        chosen = self.chosen
        return self.twin.learn(self.step, self.terminal, self.starts, chosen.episodes, seed, chosen.max_steps)

    def calls(self, graph):
        """(entry, task, state, call) of every entry of a graph."""
        for s, kind in enumerate(graph.kind_of):
            for task, name in enumerate(self.names):
                for x in range(graph.begin[kind, task], graph.end[kind, task]):
                    child = int(graph.child[graph.child_start[kind] + x])
                    call = child if child < graph.n_actions else self.names[child - graph.n_actions]
                    yield graph.first[s] + x, name, s, call

    def take(self, learner):
        """Hold what a compiled learner has learned."""
        twin, outer = self.twin, learner.own if learner.outer is None else learner.outer
        twin.move_value = learner.move_value.tolist()
        for entry, name, s, call in self.calls(learner.graph):
            twin.own[name, s, call], twin.outer[name, s, call] = float(learner.own[entry]), float(outer[entry])


def compare_maxq(model, tasks, chosen, seed):
    """Whatever is learned is the same to the last bit."""
    learner = finished(start_learner(model, "maxq-q", chosen, seed))
    told = TextbookMaxq(model, chosen, tasks)
    steps, returns = told.learn(seed)
    assert learner.progress.steps.tolist() == steps
    assert learner.progress.returns.tolist() == returns
    graph, twin = learner.graph, told.twin
    assert learner.move_value.tolist() == twin.move_value
    outer = learner.own if learner.outer is None else learner.outer
    compared = 0
    for entry, *key in told.calls(graph):
        name, s, call = key
        assert graph.open[entry] == (call in twin.open(name, s))
        if graph.open[entry]:
            compared += 1
            assert learner.own[entry] == twin.own.get((name, s, call), 0.0)
            assert outer[entry] == twin.outer.get((name, s, call), 0.0)
    assert compared > len(model)
