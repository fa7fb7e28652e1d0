"""What was learned beside exact values: every number again, state by state, by textbook dynamic programming."""

import json
import math
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest

import qualrl
from qualrl.answers import sureness
from qualrl.commands.learned import model_in, training_in
from qualrl.errors import MapError, NoPlanError, ScenarioError, SettingError
from qualrl.kernels import stepping
from qualrl.learning.changes import Change
from qualrl.learning.counting import visits_again
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner
from qualrl.models.tabular_mdp import TabularMDP
from qualrl.qualitative.from_counts import Counts
from tests import oracles
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.worlds import TWO_ROOMS, grid_of

GAMMA = 0.95
SCENARIO = "map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\nlearn: {algorithm: hql-replay, episodes: 3, gamma: 0.95}\n"


def model_of(text=LOOP, slip=0.0, goal=(2, 24), start=(2, 2), directions=4):
    regions = qualrl.segment(grid_of(text))
    return qualrl.build(regions, list(goal), start=list(start), gamma=GAMMA, slip=slip, directions=directions)


def textbook(model):
    """{state: {action: exact value}} by value iteration over dictionaries."""
    twin = oracles.GridTwin(model.grid.free, model.grid.goal_cell, model.grid.directions, model.grid.slip)
    value = twin.values(GAMMA)
    return {
        state: [
            sum(
                p * (reward + (0.0 if to == twin.goal else GAMMA * value[to]))
                for p, to, reward in twin.outcomes(cell, a)
            )
            for a in range(len(twin.moves))
        ]
        for state, cell in enumerate(twin.cells)
        if cell != twin.goal
    }


def judged(q, exact, tried):
    """(error, whether the best is optimal, how firm the order of the two best is) of one state, by the definitions."""
    best = [a for a in range(len(q)) if q[a] == max(q)]
    right = all(exact[a] > max(exact) - 1e-7 for a in best)
    first, second = sorted(range(len(q)), key=lambda a: -q[a])[:2]
    errors = abs(q[first] - exact[first]) + abs(q[second] - exact[second])
    if not (tried[first] and tried[second]):
        order = "untried"
    elif (exact[first] if q[first] > q[second] else max(exact[first], exact[second])) < max(exact) - 1e-7:
        order = "wrong"
    elif abs(exact[first] - exact[second]) < 1e-7:
        order = "equal"
    else:
        order = "settled" if q[first] - q[second] > errors else "unsettled"
    return abs(max(q) - max(exact)), right, order


def check(part, states, run, exact):
    """One part of an answer against its states, taken one by one."""
    made = np.isfinite(run.q) & (run.q != 0) if run.visits is None else run.visits > 0
    tried = made & np.isfinite(run.q)
    seen = [state for state in states if made[state].any()]
    assert (part.states, part.visited) == (len(states), len(seen))
    fewest = min((int(run.visits[state].sum()) for state in seen), default=None) if run.visits is not None else None
    assert part.fewest_visits == fewest
    found = [judged(run.q[state].tolist(), exact[state], tried[state]) for state in seen]
    if not found:
        assert (part.mean_error, part.worst_error) == (None, None)
        return set()
    errors = [error for error, _, _ in found]
    assert part.mean_error == pytest.approx(sum(errors) / len(errors), abs=1e-7)
    assert part.worst_error == pytest.approx(max(errors), abs=1e-7)
    assert part.optimal == sum(right for _, right, _ in found)
    orders = [order for _, _, order in found]
    for order in ("settled", "unsettled", "wrong", "equal", "untried"):
        assert getattr(part, order) == orders.count(order), order
    return set(orders)


RUNS = [
    ("q-learning", {"alpha": 0.3, "episodes": 60}, 0.0, 4),
    ("q-learning", {"alpha": "1/(1+k)**0.6", "episodes": 400}, 0.2, 4),
    ("hql", {"alpha": 0.5, "episodes": 300, "epsilon": 0.5}, 0.0, 4),
    ("sarsa-lambda", {"alpha": 0.2, "episodes": 100}, 0.0, 8),
    ("dyna-q", {"alpha": 0.5, "episodes": 30}, 0.1, 4),
    ("prioritized-sweeping", {"episodes": 10}, 0.0, 4),
    ("hql-replay", {"episodes": 40, "epsilon": 0.3}, 0.2, 8),
]


@pytest.mark.no_cover
def test_every_number_is_that_of_the_textbook():
    seen = set()
    for algorithm, settings, slip, directions in RUNS:
        model = model_of(slip=slip, directions=directions)
        run, exact = qualrl.train(model, algorithm, seed=3, **settings), textbook(model)
        answer = run.how_sure()
        states = sorted(exact)
        seen |= check(answer.whole, states, run, exact)
        for part, region in zip(answer.regions, range(len(model.region_names)), strict=True):
            assert part.name == model.region_names[region]
            check(part, [state for state in states if model.region_of[state] == region], run, exact)
        assert answer.learned == run.q[model.start].max()
        assert answer.exact == pytest.approx(max(exact[model.start]), abs=1e-8)
        assert answer.error == pytest.approx(abs(answer.learned - max(exact[model.start])), abs=1e-7)
        assert answer.counts == (run.visits is not None)
        assert ("What its values tend to" in answer.explain()) == (
            algorithm in ("sarsa-lambda", "prioritized-sweeping")
        )
    assert seen == {"settled", "unsettled", "wrong", "equal", "untried"}


@pytest.mark.parametrize(
    ("held", "exact", "tried", "order"),
    [
        ((5.0, 4.0, 0.0), (5.0, 5.0, 9.0), (True, True, False), "wrong"),  # the best one was never tried
        ((9.0, 4.0, 1.0), (6.0, 5.0, 7.0), (True, True, True), "wrong"),
        ((5.0, 5.0, 0.0), (5.0, 4.0, 9.0), (True, True, True), "wrong"),
        ((5.0, 5.0, 0.0), (5.0, 9.0, 1.0), (True, True, True), "unsettled"),
        ((5.0, 4.0, 0.0), (9.0, 9.0, 9.0), (True, True, False), "equal"),
        ((9.0, 4.0, 0.0), (9.0, 4.0, 9.0), (True, True, True), "settled"),
        ((5.0, 4.0, 0.0), (5.0, 5.0, 9.0), (True, False, True), "untried"),
    ],
)
def test_an_order_of_two_is_wrong_where_a_third_action_is_best(held, exact, tried, order):
    found = sureness._order(*(np.array([row]) for row in (held, exact, tried)))
    assert sureness.ORDERS[int(found[0])] == order
    assert judged(held, exact, tried)[2] == order


def test_where_what_is_held_for_best_is_not_the_order_is_not_called_right():
    run = qualrl.train(model_of(), "q-learning", seed=3, alpha=0.3, episodes=60)
    for part in run.how_sure().regions:
        assert part.visited - part.optimal <= part.wrong + part.unsettled + part.untried


def test_the_steps_are_those_of_the_learned_plan():
    model = model_of()
    run, exact = qualrl.train(model, "hql-replay", episodes=60, epsilon=0.1), textbook(model)
    answer, plan = run.how_sure(), run.plan()
    assert answer.arrives
    path = [int(model.grid.state_of[cell]) for cell in plan.path[:-1]]
    legs = [list(states) for _, states in groupby(path, key=lambda state: int(model.region_of[state]))]
    assert [part.name for part in answer.steps] == list(plan.places)
    for part, states in zip(answer.steps, legs, strict=True):
        check(part, states, run, exact)
    elsewhere = run.how_sure("room B")
    assert elsewhere.start == "room B"
    assert elsewhere.regions == answer.regions


def test_a_way_that_goes_round_in_circles_is_told():
    answer = qualrl.train(model_of(), "q-learning", episodes=1, max_steps=50).how_sure()
    assert not answer.arrives
    assert "The learned way from row 2, column 2 in room B, which does not arrive:" in answer.explain().splitlines()


@pytest.mark.parametrize(
    ("algorithm", "alpha"),
    [("q-learning", "1/(1+k)"), ("hql", "1/(1+k)"), ("sarsa", "1/(1+k)"), ("q-lambda", "1/(1+k)"), ("td", "1/(1+k)"),
     ("dyna-q", 0.5), ("prioritized-sweeping", 0.5), ("hql-replay", 0.5)],
)  # fmt: skip
def test_visits_are_those_counted_step_by_step(algorithm, alpha):
    model = model_of(TWO_ROOMS, slip=0.1, goal=(2, 15), start=(4, 2))
    run = qualrl.train(model, algorithm, seed=5, alpha=alpha, episodes=8)
    learner = start_learner(model, algorithm, LearnSettings(alpha=alpha, episodes=8), 5)
    left, whole = np.zeros(len(model), int), learner.progress.whole
    while whole[stepping.EPISODE] < 8:
        left[model.start if whole[stepping.STEPS] == 0 else whole[stepping.STATE]] += 1
        learner.advance(1)
    np.testing.assert_array_equal(run.visits.sum(axis=1), left)
    assert run.visits.sum() == run.total_steps


@pytest.mark.parametrize("algorithm", ["q-learning", "hql", "sarsa", "q-lambda", "td"])
def test_visits_counted_afterwards_are_those_of_the_same_run(algorithm):
    model = model_of(TWO_ROOMS, slip=0.1, goal=(2, 15), start=(4, 2))
    run = qualrl.train(model, algorithm, seed=5, alpha=0.3, episodes=8)
    assert run.visits is None
    assert not run.how_sure().counts
    visits = visits_again(run)
    assert visits.sum() == run.total_steps
    np.testing.assert_array_equal(visits > 0, run.q != 0)
    answer = run.how_sure(count=True)
    assert answer.counts
    assert answer.whole.fewest_visits == visits.sum(axis=1)[visits.any(axis=1)].min()


@pytest.mark.parametrize("algorithm", ["option-q", "maxq-q", "w-learning"])
def test_of_hierarchies_visits_are_counted_and_moves_that_no_way_begins_with_have_no_order(algorithm):
    model = model_of()
    run, exact = qualrl.train(model, algorithm, seed=3, alpha=0.3, episodes=40, epsilon=0.3), textbook(model)
    run = replace(run, visits=visits_again(run))
    assert run.visits.sum() == run.total_steps
    answer = run.how_sure()
    assert answer.counts
    check(answer.whole, sorted(exact), run, exact)


def test_visits_of_runs_that_do_not_come_out_the_same_are_not_made_up():
    model = model_of()
    changed = qualrl.train(model, "q-learning", episodes=20, changes=[Change(10, "door 1")])
    with pytest.raises(SettingError, match="gave other values"):
        changed.how_sure(count=True)


def test_a_learner_of_a_policy_has_values_but_no_order():
    model = model_of(TWO_ROOMS, goal=(2, 15), start=(4, 2))
    run = qualrl.train(model, "td", episodes=50, alpha=0.2)
    answer = run.how_sure()
    policy = run.exact_values
    seen = [state for state in range(len(model)) if run.q[state, 0] != 0]
    assert answer.whole.visited == len(seen)
    assert answer.whole.worst_error == pytest.approx(max(abs(run.q[state, 0] - policy[state]) for state in seen))
    assert (answer.whole.optimal, answer.whole.wrong, answer.steps) == (None, None, ())
    assert "order" not in answer.explain()


def test_models_without_a_map_are_asked_too():
    ring = {s: {a: [(1.0, (s + 1 - 2 * a) % 5, -1.0, False)] for a in (0, 1)} for s in range(5)}
    ring[4] = {0: [(1.0, 0, 10.0, True)], 1: [(1.0, 3, -1.0, False)]}
    table = TabularMDP.from_outcomes(ring, gamma=0.9)
    model = qualrl.HybridMDP.from_table(table, ["a", "b", "b", "c", "c"], start=1)
    answer = qualrl.train(model, "hql-replay", episodes=60, epsilon=0.3).how_sure()
    assert [part.name for part in answer.steps] == ["b", "c"]
    assert answer.whole.optimal == answer.whole.states == 4
    assert answer.error == pytest.approx(0, abs=1e-9)
    started_nowhere = qualrl.HybridMDP.from_table(table, ["a", "b", "b", "c", "c"])
    with pytest.raises(SettingError, match="where to start"):
        qualrl.train(started_nowhere, "hql-replay", episodes=5).how_sure()


def test_where_no_way_leads_to_the_goal_it_is_not_asked():
    model = model_of(TWO_ROOMS.replace("#.................#", "#........#........#"), goal=(2, 2), start=(3, 3))
    run = qualrl.train(model, "q-learning", episodes=5)
    assert run.how_sure().whole.states == 55
    with pytest.raises(NoPlanError):
        run.how_sure([2, 12])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a scenario, what was learned of it in "out", and its model alone in "bare"."""
    here = tmp_path_factory.mktemp("how-sure")
    draw(here, "loop", LOOP)
    (here / "loop.scenario.yaml").write_text(SCENARIO)
    qualrl_command("learn", "loop.scenario.yaml", "-o", "out", cwd=here)
    qualrl_command("convert", "loop.yaml", "-o", "bare", cwd=here)
    return here


def test_the_answer_says_what_its_fields_hold(folder):
    document = json.loads(qualrl_command("how-sure", "out", "--json", cwd=folder)[0])
    sentences = document["sentences"]
    assert qualrl_command("how-sure", "out", cwd=folder)[0].splitlines() == sentences
    assert sentences[0].startswith(f"hql-replay, 3 episodes with seed 0, {document['total_steps']:,} steps")
    learned, exact, error = document["learned"], document["exact"], document["error"]
    assert sentences[1].endswith(f": {learned:.6g} learned, {exact:.6g} exact, error {error:.3g}.")
    assert error == pytest.approx(math.fabs(learned - exact), abs=1e-9)
    parts = [document["whole"], *document["regions"], *document["steps"]]
    told = [line for line in sentences if "states visited" in line]
    assert len(told) == len(parts) > 6
    for part, line in zip(parts, told, strict=True):
        if not part["visited"]:
            assert line == f"{part['name']}: none of {part['states']} states visited"
            continue
        assert f"{part['name']}: {part['visited']} of {part['states']} states visited" in line
        assert f"error {part['mean_error']:.3g} on average, {part['worst_error']:.3g} at most" in line
        assert f"best action optimal in {part['optimal']};" in line
        for order, words in (("settled", "settled"), ("unsettled", "not settled"), ("wrong", "wrong")):
            assert (f" {part[order]} {words}" in line) == (part[order] > 0)
    assert sum(part["visited"] for part in document["regions"]) == document["whole"]["visited"]


def test_folders_without_a_training_are_refused_in_one_line(folder):
    for argument, words in (("loop.yaml", "is no folder"), ("bare", "nothing was learned there")):
        (line,) = qualrl_command("how-sure", argument, cwd=folder, expect=2)[1].splitlines()
        assert words in line
    (folder / "old").mkdir()
    with pytest.raises(ScenarioError, match=r"holds no hybrid_mdp\.npz"):
        model_in(folder / "old")
    np.savez(folder / "old" / "training.npz", about=np.array(json.dumps({"format": "qualrl-training/0"})))
    with pytest.raises(MapError, match="qualrl-training/0"):
        training_in(folder / "old", model_in(folder / "out"))
    with pytest.raises(MapError, match="another model"):
        training_in(folder / "out", model_of())


@pytest.mark.parametrize("slip", [0.0, 0.2])
def test_other_seeds_are_runs_of_their_own(slip):
    """Each run learned again here, and its way followed by hand."""
    model = model_of(slip=slip)
    run = qualrl.train(model, "q-learning", episodes=60, alpha=0.2, epsilon=0.3, seed=4)
    found = run.how_sure(seeds=3)
    exact, goal = textbook(model), model.grid.goal
    runs = [qualrl.train(model, "q-learning", episodes=60, alpha=0.2, epsilon=0.3, seed=seed) for seed in (4, 5, 6, 7)]
    arrived, optimal = 0, 0
    for other in runs:
        state, walk = model.start, []
        while state != goal and state not in walk:
            walk.append(state)
            state = int(model.grid.successor[state, int(other.q[state].argmax())])
        arrived += state == goal
        right = [exact[at][int(other.q[at].argmax())] > max(exact[at]) - 1e-7 for at in walk]
        optimal += state == goal and all(right)
    assert found.others.seeds == (4, 5, 6, 7)
    assert (found.others.arrives.runs, found.others.optimal.runs) == (arrived, optimal)
    errors = [abs(other.q[model.start].max() - max(exact[model.start])) for other in runs]
    assert found.others.errors == pytest.approx(errors, abs=1e-6)
    assert found.others.arrives.interval == Counts(arrived, 4).interval(0.95)
    for region, share in found.others.regions:
        entered = next(state for state in walk_of(runs[0]) if model.region_names[model.region_of[state]] == region)
        right = [exact[entered][int(other.q[entered].argmax())] > max(exact[entered]) - 1e-7 for other in runs]
        assert share.runs == sum(right)
    said = found.explain()
    assert "Learned with other seeds too: 4 runs, seeds 4 to 7." in said
    assert "This is one run" not in said
    assert "runs" in found.explain("signs")


def walk_of(run):
    state, goal, walk = run.model.start, run.model.grid.goal, []
    while state != goal and state not in walk:
        walk.append(state)
        state = int(run.model.grid.successor[state, int(run.q[state].argmax())])
    return walk


def test_where_other_seeds_would_say_nothing_it_is_refused():
    model = model_of()
    with pytest.raises(SettingError, match="other seeds must be 1 or more"):
        qualrl.train(model, "hql", episodes=2).how_sure(seeds=-1)
    with pytest.raises(SettingError, match="chooses nothing"):
        qualrl.train(model, "td", episodes=2).how_sure(seeds=2)
    changed = qualrl.train(model, "hql", episodes=4, changes=[Change(2, "door 1")])
    with pytest.raises(SettingError, match="whose world changed"):
        changed.how_sure(seeds=2)
