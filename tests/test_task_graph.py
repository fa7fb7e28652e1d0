"""Task graphs, and MAXQ-Q on them against a textbook twin, draw for draw."""

import pytest

from qualrl.errors import SettingError, UnknownNameError
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import train
from qualrl.models.grid_world import GridWorld
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.models.task_graph import Task, TaskGraph
from tests.hierarchical_worlds import (
    FALLING,
    RATES,
    compare_maxq,
    halves,
    model_of,
    table_model,
    tasks_by_hand,
    tasks_of,
)
from tests.test_learning import puzzle
from tests.worlds import grid_of

TWO_EXITS = """
##########
#...#....#
#........#
#...####.#
#...#....#
#...#.####
#........#
#...#....#
##########
"""


@pytest.mark.parametrize(
    ("model", "primitives", "seed", "alpha"),
    [
        (halves(start=(5, 1)), True, 1, 0.2), (halves(0.3), False, 2, 0.2), (table_model(), True, 3, 0.2),
        (puzzle(), False, 4, 0.2), (halves(0.3), True, 5, FALLING), (table_model(), False, 6, FALLING),
    ],
    ids=["halves", "halves slip", "table", "puzzle", "halves falling", "table falling"],
)  # fmt: skip
def test_maxq_equals_the_textbook_draw_for_draw(model, primitives, seed, alpha):
    chosen = LearnSettings(episodes=8, alpha=alpha, epsilon=0.1, max_steps=250, primitives=primitives)
    compare_maxq(model, tasks_of(model, primitives), chosen, seed)


class Taxi:
    """A 3 x 2 town with a stop at either end: states are (cell, passenger: stop 0, stop 1 or 2 = inside, target)."""

    STOPS = (0, 5)
    MOVES = ("north", "south", "west", "east", "pick up", "put down")

    def __init__(self):
        outcomes = {s: {a: [(1.0, *self.after(s, a))] for a in range(6)} for s in range(37)}
        self.mdp = TabularMDP.from_outcomes(outcomes, 0.9, self.MOVES)
        decoded = [self.decode(s) for s in range(36)]
        outside = [s for s in range(37) if s == 36 or decoded[s][1] < 2]
        inside = [s for s in range(36) if decoded[s][1] == 2]
        at = {k: [s for s in range(36) if decoded[s][0] == self.STOPS[k]] for k in (0, 1)}
        waits = {f"go to {k}": [s for s in range(36) if decoded[s][1] == k] for k in (0, 1)}
        wants = {f"go to {k}": [s for s in range(36) if decoded[s][2] == k] for k in (0, 1)}
        self.tasks = [
            Task("root", ("get", "put")),
            Task("get", ("go to 0", "go to 1", "pick up"), ends=inside, only=waits),
            Task("put", ("go to 0", "go to 1", "put down"), ends=outside, only=wants),
            Task("go to 0", self.MOVES[:4], ends=at[0]),
            Task("go to 1", self.MOVES[:4], ends=at[1]),
        ]
        graph = TaskGraph.from_tasks(self.tasks, self.mdp)
        names = ["town" if s < 36 else "done" for s in range(37)]
        plain = HybridMDP.from_table(self.mdp, names)
        fields = {name: getattr(plain, name) for name in plain.__dataclass_fields__}
        self.model = HybridMDP(**(fields | {"tasks": graph, "start": 12 * 2 + 0}))

    @staticmethod
    def decode(s):
        return s // 6, s // 2 % 3, s % 2

    def after(self, s, a):
        if s == 36:
            return 36, 0.0, True
        cell, passenger, target = self.decode(s)
        row, column = divmod(cell, 2)
        if a < 4:
            row, column = (max(row - 1, 0), column) if a == 0 else (min(row + 1, 2), column) if a == 1 else (row, a - 2)
            return ((row * 2 + column) * 3 + passenger) * 2 + target, -1.0, False
        if a == 4 and passenger < 2 and cell == self.STOPS[passenger]:
            return (cell * 3 + 2) * 2 + target, -1.0, False
        if a == 5 and passenger == 2 and cell == self.STOPS[target]:
            return 36, 20.0, True
        return s, -10.0, False


@pytest.mark.parametrize("alpha", list(RATES))
def test_maxq_on_a_graph_of_the_users_own_equals_the_textbook_and_finds_the_optimum(alpha):
    taxi = Taxi()
    assert taxi.model.tasks.depth == 3
    chosen = LearnSettings(episodes=40, alpha=alpha, epsilon=0.2, max_steps=100)
    compare_maxq(taxi.model, tasks_by_hand(taxi.tasks, taxi.mdp), chosen, 5)
    run = train(taxi.model, "maxq-q", LearnSettings(episodes=4000, alpha=alpha, epsilon=0.2, max_steps=100), seed=1)
    assert run.greedy_steps == run.optimal_steps
    assert run.q[36].tolist() == [0.0] * 6


def test_a_task_graph_says_what_is_wrong_with_it():
    world = halves().grid
    with pytest.raises(UnknownNameError, match="did you mean 'up'"):
        TaskGraph.from_tasks([Task("root", ("upp",))], world)
    with pytest.raises(SettingError, match="ends up calling itself: root > deep > root"):
        TaskGraph.from_tasks([Task("root", ("deep",)), Task("deep", ("root", "up"))], world)
    with pytest.raises(SettingError, match="two things called 'up'"):
        TaskGraph.from_tasks([Task("root", ("up",)), Task("up", ("down",))], world)
    with pytest.raises(SettingError, match="nothing to call in state 3"):
        TaskGraph.from_tasks([Task("root", ("up",), ends=[3])], world)
    with pytest.raises(SettingError, match="outside 0 to"):
        TaskGraph.from_tasks([Task("root", ("up",), ends=[3000])], world)
    with pytest.raises(UnknownNameError, match="does not call 'left'"):
        TaskGraph.from_tasks([Task("root", ("up",), only={"left": [1]})], world)
    with pytest.raises(SettingError, match="needs a root"):
        TaskGraph.from_tasks([], world)


def two_exit_model(**changes):
    """Dietterich's room with two exits: from the start the upper one is nearer, the lower one is on the better way."""
    world = GridWorld(grid_of(TWO_EXITS).free, (7, 7), 0.9, goal_reward=-1.0)
    west = [s for s, (_, c) in enumerate(world.cells.tolist()) if c <= 3]
    east = [s for s in range(len(world)) if s not in west]
    graph = TaskGraph.from_tasks(
        [
            Task("root", ("leave", "reach")),
            Task("leave", world.action_names, ends=east, **changes),
            Task("reach", world.action_names, ends=west, pseudo=dict.fromkeys(west, -50.0)),
        ],
        world,
    )
    plain = model_of(world.free, (7, 7), {}, start=(3, 2), prize=-1.0)
    fields = {name: getattr(plain, name) for name in plain.__dataclass_fields__}
    return HybridMDP(**(fields | {"tasks": graph})), world


def test_maxq_tends_to_the_recursive_optimum_which_is_not_the_hierarchical_one():
    """From (3, 2) the upper exit is 3 steps away and 14 more lead on; the lower one 5 and 4."""
    model, world = two_exit_model()
    upper, lower = int(world.state_of[2, 4]), int(world.state_of[6, 4])
    recursive, optimal = 3 + 14, 5 + 4
    chosen = LearnSettings(episodes=6000, alpha=0.5, epsilon=0.02, max_steps=500)
    run = train(model, "maxq-q", chosen, seed=1)
    assert run.optimal_steps == optimal < recursive == run.greedy_steps
    told, _ = two_exit_model(pseudo={upper: -5.0, lower: 0.0})
    assert train(told, "maxq-q", chosen, seed=1).greedy_steps == optimal
