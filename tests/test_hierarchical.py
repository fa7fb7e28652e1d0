"""The hierarchical learners: each loop against a textbook twin, draw for draw, and what holds of them all."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from qualrl.learning.hierarchical import landmark_tasks, worst_return
from qualrl.learning.settings import LearnSettings
from qualrl.learning.trainer import start_learner, train
from qualrl.models.hybrid_mdp import HybridMDP
from qualrl.models.landmark_ways import LandmarkWays
from tests import oracles
from tests import oracles_tasks as twins
from tests.hierarchical_worlds import (
    FALLING,
    LANDMARK_LEARNERS,
    LEARNERS,
    RATES,
    TextbookMaxq,
    detour_model,
    finished,
    halves,
    inner_values,
    model_of,
    same,
    stepper,
    table_model,
    tasks_of,
    top_values,
)
from tests.test_learning import puzzle
from tests.worlds import free_masks


@pytest.mark.parametrize("algorithm", LANDMARK_LEARNERS)
@pytest.mark.parametrize(
    ("model", "primitives", "seed", "alpha"),
    [
        (halves(start=(5, 1)), True, 1, 0.2), (halves(0.3), False, 2, 0.2), (halves(0.2, (5, 1), 8), True, 3, 0.2),
        (puzzle(), True, 4, 0.2), (puzzle(None, 0.1), False, 5, 0.2), (table_model(), True, 6, 0.2),
        (table_model(), False, 7, 0.2), (halves(0.3), True, 8, FALLING), (puzzle(None, 0.1), False, 9, FALLING),
        (table_model(), True, 10, FALLING),
    ],
    ids=[
        "halves", "halves slip", "eight", "puzzle", "puzzle slip", "table", "table no moves", "halves falling",
        "puzzle falling", "table falling",
    ],
)  # fmt: skip
def test_compiled_loop_equals_the_textbook_draw_for_draw(algorithm, model, primitives, seed, alpha):
    chosen = LearnSettings(episodes=10, alpha=alpha, epsilon=0.1, max_steps=250, primitives=primitives)
    learner = finished(start_learner(model, algorithm, chosen, seed))
    step, likely, terminal = stepper(model)
    marks = twins.Landmarks(model, likely, terminal)
    top, inner, steps, returns = twins.learn_landmarks(
        algorithm, step, marks, model.starts.tolist(), gamma=0.9, rate=RATES[alpha], epsilon=0.1, episodes=10,
        seed=seed, max_steps=250, primitives=primitives, worst=worst_return(model),
    )  # fmt: skip
    assert learner.progress.steps.tolist() == steps
    np.testing.assert_allclose(learner.progress.returns, returns, rtol=1e-12)
    for s, values in enumerate(top):
        same(top_values(learner, marks, s), values)
    if algorithm not in ("option-q", "intra-option-q"):
        for (option, s), values in inner.items():
            same(inner_values(learner, marks, s, option), values)


@pytest.mark.parametrize("algorithm", LEARNERS)
def test_moves_are_counted_as_the_textbook_makes_them(algorithm):
    model = halves(0.3)
    chosen = LearnSettings(episodes=10, alpha=0.2, epsilon=0.1, max_steps=250)
    counts, uncounted = start_learner(model, algorithm, chosen, 2), finished(start_learner(model, algorithm, chosen, 2))
    counts.count_visits()
    learned = finished(counts).learned()
    step, likely, terminal = stepper(model)
    made = np.zeros(learned.q.shape, int)

    def counted(state, move, draws):
        made[state, move] += 1
        return step(state, move, draws)

    if algorithm == "maxq-q":
        told = TextbookMaxq(model, chosen, tasks_of(model, chosen.primitives))
        told.step = counted
        told.learn(2)
    else:
        twins.learn_landmarks(
            algorithm, counted, twins.Landmarks(model, likely, terminal), model.starts.tolist(), gamma=0.9,
            rate=RATES[0.2], epsilon=0.1, episodes=10, seed=2, max_steps=250, primitives=chosen.primitives,
            worst=worst_return(model),
        )  # fmt: skip
    np.testing.assert_array_equal(learned.visits, made)
    assert learned.visits.sum() == counts.progress.steps.sum()
    np.testing.assert_array_equal(learned.q, uncounted.learned().q)
    assert uncounted.learned().visits is None


@pytest.mark.parametrize("algorithm", [name for name in LANDMARK_LEARNERS if name != "w-learning"])
@given(model=st.sampled_from([halves(start=(5, 1)), halves(0.2, (5, 1), 8), halves(0.3), puzzle(), table_model()]),
       episodes=st.integers(1, 40), primitives=st.booleans(), seed=st.integers(0, 99))  # fmt: skip
@settings(max_examples=25, deadline=None)
def test_what_is_polled_equals_the_textbook(algorithm, model, episodes, primitives, seed):
    chosen = LearnSettings(episodes=episodes, alpha=0.3, epsilon=0.1, max_steps=40, primitives=primitives)
    learner = finished(start_learner(model, algorithm, chosen, seed))
    _, likely, terminal = stepper(model)
    marks = twins.Landmarks(model, likely, terminal)
    top = [{} if terminal(s) else top_values(learner, marks, s) for s in range(len(model))]
    wanted = twins.polled(
        marks, top, lambda option, s: None if "option" in algorithm else inner_values(learner, marks, s, option),
        None if algorithm == "switch" else model.start,
    )  # fmt: skip
    for s, values in enumerate(learner.learned().q.tolist()):
        assert {move: value for move, value in enumerate(values) if value > -np.inf} == (
            dict.fromkeys(range(len(values)), 0.0) if terminal(s) else wanted[s]
        )


@pytest.mark.parametrize("alpha", [0.3, "1/(1+k)**0.6"])
@pytest.mark.parametrize("algorithm", LEARNERS)
def test_slices_of_any_size_give_the_same_run_and_seeds_another(algorithm, alpha):
    model = halves(0.1)
    chosen = LearnSettings(episodes=30, alpha=alpha, epsilon=0.1, max_steps=400)
    whole = finished(start_learner(model, algorithm, chosen, 3))
    pieces = start_learner(model, algorithm, chosen, 3)
    size = 1
    while pieces.advance(size) == size:
        size = size % 7 + 1
    np.testing.assert_array_equal(whole.progress.steps, pieces.progress.steps)
    np.testing.assert_array_equal(whole.learned().q, pieces.learned().q)
    other = finished(start_learner(model, algorithm, chosen, 4))
    assert not np.array_equal(whole.progress.steps, other.progress.steps)


@pytest.mark.parametrize("algorithm", LEARNERS)
@pytest.mark.parametrize(("primitives", "steps"), [(True, 5), (False, 13)])
def test_what_a_hierarchy_costs(algorithm, primitives, steps):
    """The goal is 5 steps off; by the landmark in the top row it is 13."""
    model = detour_model((4, 1))
    run = train(model, algorithm, LearnSettings(episodes=20_000, alpha=0.2, epsilon=0.5, primitives=primitives), seed=2)
    assert run.optimal_steps == 5
    if algorithm == "w-learning":  # nobody in the west wants what lies beyond its own region
        assert run.greedy_steps == 13
    else:
        assert run.greedy_steps == steps


@pytest.mark.parametrize("algorithm", LEARNERS)
def test_each_learner_finds_the_shortest_way_through_the_puzzle(algorithm):
    chosen = LearnSettings(episodes=3000, alpha=0.1, epsilon=0.1, primitives=True)
    run = train(puzzle(), algorithm, chosen, seed=0)
    assert run.greedy_steps == 32
    assert not np.isnan(run.q).any()
    assert (run.q.max(axis=1) > -np.inf).all()
    assert np.isfinite(run.max_error)


@given(st.data(), free_masks(side=6), st.sampled_from(LEARNERS), st.booleans(), st.sampled_from([4, 8]))
@settings(max_examples=30, deadline=None)
def test_on_any_small_map_the_learned_way_arrives_and_no_value_beats_the_optimum(data, free, name, primitives, moves):
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    assume(len(cells) > 2)
    goal, start = data.draw(st.permutations(cells))[:2]
    marks = data.draw(st.lists(st.sampled_from(cells), unique=True, max_size=5))
    joined = {cell: data.draw(st.sampled_from([(0,), (1,), (0, 1)])) for cell in marks}
    model = model_of(free, goal, joined, start=start, directions=moves)
    chosen = LearnSettings(episodes=2000, alpha=0.5, epsilon=0.3, primitives=primitives, max_steps=3000)
    run = train(model, name, chosen, seed=1)
    exact = np.array(list(oracles.GridTwin(free, goal, moves).values(0.9).values()))
    assume(exact.min() >= 0)  # values begin at 0
    if name == "maxq-q":
        return  # its completions are averages over exploring calls: they may be better, and may hold it off the goal
    assert (run.q.max(axis=1) <= exact + 1e-9).all()
    if name != "w-learning":
        assert run.greedy_steps is not None
        assert run.greedy_steps >= run.optimal_steps


def test_moves_are_offered_where_no_option_leads_on():
    """Two landmarks in the west that lead to each other only; the crossing to the east has none."""
    model = model_of(np.ones((3, 6), bool), (1, 5), {(0, 0): (0,), (2, 0): (0,)})
    ways = LandmarkWays.of(model)
    assert ways.stuck[model.region_of == 0].all()
    assert not ways.stuck[model.region_of == 1].any()
    lonely = HybridMDP(**({n: getattr(model, n) for n in model.__dataclass_fields__} | {"start": 0}))
    for algorithm in ("option-q", "intra-option-q", "hamq", "switch", "maxq-q"):
        chosen = LearnSettings(episodes=3000, alpha=0.2, epsilon=0.2, primitives=False, max_steps=2000)
        assert train(lonely, algorithm, chosen, seed=0).greedy_steps == 6


def test_the_ways_of_a_doorway_belong_to_both_of_its_rooms():
    model = halves()
    ways = LandmarkWays.of(model)
    door = int(model.grid.state_of[2, 4])
    kind = ways.kind_of[door]
    here = ways.option[ways.option_start[kind] : ways.option_start[kind + 1]]
    assert {ways.names[o].split(" in ")[1] for o in here} == {"west", "east"}
    graph = landmark_tasks(model)
    assert graph.depth == 2
    assert graph.has_pseudo_rewards
    assert not landmark_tasks(puzzle()).has_pseudo_rewards
