"""Answers against the model checker Storm, which shares nothing with qualrl; skipped where it is not installed.

Storm knows no discount, so each step of discount d goes on with probability d and stops with 1 - d.
"""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import sympy
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers.contingent import Contingent
from qualrl.answers.uncertain import Uncertain
from qualrl.planning.planner import exact_walk
from qualrl.qualitative.plan_value import Chance
from qualrl.solving.exact import exact_values
from tests.test_planning import LOOP
from tests.test_why_not import COURSES
from tests.worlds import TWO_ROOMS, grid_of

stormpy = pytest.importorskip("stormpy", reason="Storm is not installed; pip install 'qualrl[storm]'")

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
DOORS = [door.name for door in REGIONS.doorways]
STOPPED, ARRIVED = 0, 1


class Intervals:
    """An interval MDP in Storm's own format: plans' trees, and a first state that chooses among them."""

    def __init__(self, trees, box, scale):
        self.box, self.scale = box, scale
        self.lines = {STOPPED: [{STOPPED: (1.0, 1.0)}], ARRIVED: [{ARRIVED: (1.0, 1.0)}]}
        self.first = self.new()
        self.lines[self.first] = [{self.state(tree): (1.0, 1.0)} for tree in trees]

    def new(self):
        self.lines[len(self.lines)] = []
        return len(self.lines) - 1

    def state(self, tree):
        """The state from where ARRIVED is reached with the probability that the tree is worth, in units of scale."""
        if tree is None:
            return STOPPED
        here = self.new()
        onward = here if tree.number is None else self.new()
        if tree.number is not None:
            low, high = sorted(tree.number.at(end) for end in self.box[tree.number.key])
            self.lines[here] = [self.merged([(onward, (low, high)), (self.state(tree.instead), (1 - high, 1 - low))])]
        arrives = tree.reward / self.scale
        moves = tree.discount if tree.then is not None else 0.0
        assert arrives >= 0
        assert arrives + moves <= 1
        ends = [(ARRIVED, arrives), (self.state(tree.then), moves), (STOPPED, 1 - arrives - moves)]
        self.lines[onward] = [self.merged([(state, (share, share)) for state, share in ends if share > 0])]
        return here

    @staticmethod
    def merged(arcs):
        found = {}
        for state, (low, high) in arcs:
            before = found.get(state, (0.0, 0.0))
            found[state] = before[0] + low, before[1] + high
        return {state: span for state, span in found.items() if span[1] > 0}

    def write(self, path):
        body = []
        for state, choices in self.lines.items():
            label = " init" if state == self.first else " arrived" if state == ARRIVED else ""
            body.append(f"state {state}{label}")
            for number, chances in enumerate(choices):
                body.append(f"\taction {number}")
                body += arcs(chances)
        count = sum(len(choices) for choices in self.lines.values())
        head = ["@type: MDP", "@value_type: double-interval", "@parameters", "", "@reward_models", ""]
        path.write_text(
            "\n".join([*head, "@nr_states", str(len(self.lines)), "@nr_choices", str(count), "@model", *body, ""])
        )
        return path


def best_of(path):
    """The most that the chooser gets when nature is against it, and when it helps."""
    model = stormpy.build_model_from_drn[stormpy.Interval](str(path))
    (asked,) = stormpy.parse_properties('Pmax=? [F "arrived"]')
    environment = stormpy.Environment()
    environment.solver().min_max().precision = stormpy.Rational(1e-12)
    found = []
    for mode in (stormpy.UncertaintyResolutionMode.ROBUST, stormpy.UncertaintyResolutionMode.COOPERATIVE):
        result = stormpy.model_checking(model, asked, environment=environment, uncertainty_resolution_mode=mode)
        found.append(result.get_value(model.initial_states[0]))
    return found


# Storm takes no interval that holds 0: a doorway may be shut or open, and a region takes longer than on the map.
SHARES = st.fractions(Fraction(1, 9), Fraction(8, 9), max_denominator=9)
SPANS = st.tuples(st.integers(1, 3), st.integers(1, 3)).map(lambda ends: tuple(sorted(end / 4 for end in ends)))
TIMES = st.tuples(st.integers(5, 9), st.integers(5, 9)).map(lambda ends: tuple(sorted(end / 4 for end in ends)))


@settings(deadline=None, max_examples=30)
@given(
    st.sampled_from(CELLS),
    st.sampled_from(CELLS),
    st.dictionaries(st.sampled_from(DOORS), SPANS, max_size=3),
    st.dictionaries(st.sampled_from(REGIONS.region_names), TIMES, max_size=3),
)
def test_worst_and_best_cases_are_those_of_an_interval_mdp(tmp_path_factory, start, goal, doors, times):
    assume(start != goal)
    assume(doors or times)
    model = qualrl.build(REGIONS, list(goal), start=list(start), gamma=0.95)
    answer = qualrl.questions.robust(model, doors=doors, times=times)
    contingent = Contingent(model, Uncertain(doors, times))
    trees = []
    for rival in answer.rivals:
        others = [door.name for door in REGIONS.doorways if door.name not in rival.way.doors]
        only = model.with_closed(others)
        trees.append(contingent.outlook(exact_walk(only, exact_values(only.world), model.start)))
    scale = 100 + 1 / (1 - model.gamma)
    path = tmp_path_factory.mktemp("storm") / "ways.drn"
    against, helping = best_of(Intervals(trees, contingent.box, scale).write(path))
    assert max(of.least for of in answer.rivals) == pytest.approx(against * scale - 1 / (1 - model.gamma), abs=1e-6)
    assert max(of.most for of in answer.rivals) == pytest.approx(helping * scale - 1 / (1 - model.gamma), abs=1e-6)


def test_values_where_slips_are_uncertain_are_those_of_an_interval_mdp(tmp_path):
    """A state of Storm's for each cell; for each move one where it leads where it aims at, and one where it slips."""
    low, high = 0.05, 0.3
    world = qualrl.build(qualrl.segment(grid_of(TWO_ROOMS)), [2, 16], start=[5, 2], gamma=0.95, slip=high).grid
    start, n = int(world.state_of[5, 2]), len(world)
    cells, moves, stopped = list[str](), list[str](), 9 * n

    def landing(state, ends):
        found = {stopped: 0.0}
        for to in ends:
            goes_on = 1.0 if to == world.goal else world.gamma
            found[to] = found.get(to, 0.0) + goes_on / len(ends)
            found[stopped] += (1 - goes_on) / len(ends)
        return [f"state {state}", "\taction 0", *arcs({to: (share, share) for to, share in found.items()})]

    for state, onward in enumerate(world.successor.tolist()):
        cells.append(f"state {state}{' init' if state == start else ' arrived' if state == world.goal else ''}")
        for move, aimed in enumerate(onward):
            first = n + 8 * state + 2 * move
            chances = {first: (1 - high, 1 - low), first + 1: (low, high)}
            cells += [f"\taction {move}", *arcs({state: (1.0, 1.0)} if state == world.goal else chances)]
            moves += landing(first, [aimed]) + landing(first + 1, onward[:move] + onward[move + 1 :])
    path = tmp_path / "grid.drn"
    head = ["@type: MDP", "@value_type: double-interval", "@parameters", "", "@reward_models", ""]
    head += ["@nr_states", str(9 * n + 1), "@nr_choices", str(12 * n + 1), "@model"]
    path.write_text(
        "\n".join([*head, *cells, *moves, f"state {stopped}", "\taction 0", *arcs({stopped: (1.0, 1.0)}), ""])
    )
    scale = world.goal_reward + 1 / (1 - world.gamma)
    for found, slip in zip(best_of(path), (high, low), strict=True):
        value = exact_values(replace(world, slip=slip)).value[start]
        assert found * scale - 1 / (1 - world.gamma) == pytest.approx(value, abs=1e-5)


def arcs(chances):
    return [f"\t\t{to} : [{low!r}, {high!r}]" for to, (low, high) in sorted(chances.items()) if high > 0]


def prism_of(ways, raised):
    """Storm's text of a chance between two ways, with discount g and probability p left open."""
    lines = ["dtmc", "const double g;", "const double p;", "module ways", "s : [0..{last}] init 0;"]
    rewards, firsts, at = [], [], 2
    for way in ways:
        firsts.append(at)
        paid = [stretch.reward for stretch in way.stretches for _ in range(stretch.steps)]
        for number, reward in enumerate(paid):
            onward = f"g : (s'={at + 1}) + 1 - g : (s'=1)" if number + 1 < len(paid) else "1 : (s'=1)"
            lines.append(f"[] s={at} -> {onward};")
            rewards.append(f"s={at} : {Fraction(reward) + raised};")
            at += 1
        if not paid:
            firsts[-1] = 1
    lines.insert(5, f"[] s=0 -> p : (s'={firsts[0]}) + 1 - p : (s'={firsts[1]});")
    lines.append("[] s=1 -> 1 : (s'=1);")
    lines[4] = lines[4].format(last=at)
    return "\n".join([*lines, "endmodule", 'rewards "paid"', *rewards, "endrewards", 'label "over" = s=1;', ""])


@settings(deadline=None, max_examples=30)
@given(COURSES, COURSES, SHARES, SHARES)
def test_the_formula_of_a_chance_between_two_ways_is_that_of_a_parametric_chain(tmp_path_factory, one, other, p, g):
    """Rewards are raised by 50 for Storm, which takes none below 0, and lowered again by as many discounted steps."""
    raised = 50
    path = tmp_path_factory.mktemp("storm") / "ways.prism"
    path.write_text(prism_of((one, other), raised))
    program = stormpy.parse_prism_program(str(path))
    asked = stormpy.parse_properties('R{"paid"}=? [F "over"]', program)
    model = stormpy.build_model[stormpy.RationalFunction](program, asked)
    found = str(stormpy.model_checking(model, asked[0]).get_value(model.initial_states[0])).replace("^", "**")
    point = {sympy.Symbol("p"): sympy.Rational(p), sympy.Symbol("g"): sympy.Rational(g)}
    steps = [sum(sympy.Rational(g) ** t for t in range(way.steps)) for way in (one, other)]
    less = raised * (sympy.Rational(p) * steps[0] + (1 - sympy.Rational(p)) * steps[1])
    ours = Chance(p, one, other).formula().subs("gamma", sympy.Rational(g))
    assert sympy.sympify(found).subs(point) - less == ours
