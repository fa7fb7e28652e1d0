"""The verbs of the library: build, train, plan, questions to a plan (read_map, segment, load_scenario live elsewhere).

What only one of them needs, or few of its calls, is imported there: each takes some of the first second.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from types import UnionType
from typing import TYPE_CHECKING, Any

from qualrl.errors import SettingError, UnknownNameError, did_you_mean
from qualrl.learning.run import LearningRun
from qualrl.learning.settings import LearnSettings, setting_names
from qualrl.learning.trainer import Trainer
from qualrl.models.hybrid_mdp import HybridMDP, hybrid_mdp
from qualrl.spatial.nearness import DistanceCuts
from qualrl.spatial.place import PlaceLike as PlaceOnMap
from qualrl.spatial.place import read_place
from qualrl.spatial.region_map import RegionMap

if TYPE_CHECKING:
    from qualrl.answers.how_sure import HowSure
    from qualrl.learning.changes import Change
    from qualrl.learning.online import Online
    from qualrl.learning.trainer import Milestone
    from qualrl.planning.plan import Plan
    from qualrl.qualitative.checking import Checked

CUTS = DistanceCuts()
PlaceLike = PlaceOnMap | int
"""A place as ``spatial.place.PlaceLike``, or, for a model without a map, the number of a state."""


class Training(LearningRun):
    """A finished learning run, and the plans that come out of it."""

    def plan(self, start: PlaceLike | None = None) -> "Plan":
        """The plan that what was learned gives from a start (by default the model's own).

        Where the learned values do not lead to the goal, the plan is the exact one and its notes say so.
        """
        from qualrl.planning.planner import plan_from_run

        state, name = start_of(self.model, start)
        return plan_from_run(self, state, (name, goal_name(self.model)))

    def how_sure(self, start: PlaceLike | None = None, *, count: bool = False, seeds: int = 0) -> "HowSure":
        """What was learned beside exact values, and whether the order of the two best actions is settled.

        count: learn once more, with the same seed, to count visits where the learner did not.  seeds: learn with so
        many other seeds, to see whether they learn the same.
        Raises NoPlanError when no way leads from the start (by default the model's own) to the goal, and SettingError
        where visits cannot be counted, or other seeds would say nothing.
        """
        from qualrl.answers.how_sure import how_sure
        from qualrl.learning.counting import visits_again

        counted = replace(self, visits=visits_again(self)) if count and self.visits is None else self
        return how_sure(counted, *start_of(self.model, start), seeds)


def build(
    regions: RegionMap,
    goal: PlaceLike,
    *,
    start: PlaceLike | None = None,
    gamma: float = 0.9,
    slip: float = 0.0,
    directions: int = 4,
    step_reward: float = -1.0,
    goal_reward: float = 100.0,
    names: Mapping[str, str] | None = None,
    landmarks: Mapping[str, PlaceLike] | None = None,
    levels: int = 2,
) -> HybridMDP:
    """The hybrid MDP of a map: reach ``goal``, at ``step_reward`` a step and ``goal_reward`` at the goal.

    A region's name means its centre.  start=None lets every episode start at random.  names renames regions,
    doorways and landmarks first, so goal and start use the new names.  landmarks, name -> place, take the stead of
    all that were found but doorways; one placed in a doorway takes the doorway over.
    levels counts the metric level as the first: 2 = grid and regions, 3 = and wings, which are groups of regions, 4 =
    and floors, the parts of the map that nothing connects.
    Raises UnknownNameError, PlaceError, ScenarioError or SettingError.
    """
    check_type("build", regions, RegionMap, "a RegionMap, from qualrl.segment")
    renamed = regions.renamed(names) if names else regions
    if landmarks is not None:
        from qualrl.spatial.placed_landmarks import with_landmarks

        renamed = with_landmarks(renamed, {name: read_place(place) for name, place in landmarks.items()})
    return hybrid_mdp(
        renamed,
        read_place(goal),
        start=None if start is None else read_place(start),
        gamma=gamma,
        slip=slip,
        directions=directions,
        step_reward=step_reward,
        goal_reward=goal_reward,
        levels=levels,
    )


def train(
    model: HybridMDP,
    algorithm: str = "hql-replay",
    *,
    seed: int = 0,
    watch: "Callable[[Milestone], None] | None" = None,
    changes: "Sequence[Change]" = (),
    online: "Online | None" = None,
    **settings: Any,
) -> Training:
    """Learn a model.  settings: episodes, alpha, epsilon, max_steps, eta0, eta_power, eta_counter.

    ``watch`` is called about ten times a second.  The same seed gives the same result.
    changes: doors that close and open on the way, which the learner has to find out.  online: for a robot that does
    not know the map and sees what is near.
    Raises UnknownNameError for an unknown algorithm or setting, SettingError, or NoPlanError.
    """
    check_type("train", model, HybridMDP, "a HybridMDP, from qualrl.build or HybridMDP.from_table")
    told = _settings(settings)
    if online is None:
        return Trainer(model, algorithm, told, Training).run(seed, watch, changes)
    if changes:
        raise SettingError("a robot that does not know the map cannot be given changes of it too: drop one of the two")
    from qualrl.learning.online import train_online

    return training_of(train_online(model, algorithm, told, online, seed, watch))


def train_seeds(
    model: HybridMDP,
    seeds: int | Iterable[int],
    algorithm: str = "hql-replay",
    *,
    threads: int | None = None,
    told: Callable[[int], None] | None = None,
    **settings: Any,
) -> list[Training]:
    """Learn a model once with each seed, over threads: what ``train`` gives for each, in the order of the seeds.

    seeds: those to use, or how many from 0 on.  threads: by default one for each processor.  told: called with the
    number of runs that are done.  settings: as for ``train``, which see for the errors too.
    """
    from qualrl.learning.many import over_threads

    check_type("train_seeds", model, HybridMDP, "a HybridMDP, from qualrl.build or HybridMDP.from_table")
    chosen = _settings(settings)
    wanted = range(seeds) if isinstance(seeds, int) else list(seeds)
    return over_threads(Trainer(model, algorithm, chosen, Training).run, wanted, threads, told)


def _settings(given: Mapping[str, Any]) -> LearnSettings:
    """Settings from keywords; raises UnknownNameError."""
    known = setting_names()
    for name in given:
        if name not in known:
            raise UnknownNameError(f"no setting is called {name!r}; {did_you_mean(name, known)}")
    return LearnSettings(**given)


def check_type(verb: str, given: object, wanted: type | UnionType, words: str) -> None:
    """Raise TypeError for an argument that another verb makes."""
    if not isinstance(given, wanted):
        raise TypeError(f"{verb} needs {words}, got {type(given).__name__}")


def training_of(run: LearningRun) -> Training:
    """A run that can plan; it shares all arrays, and what was worked out of them."""
    training = Training.__new__(Training)
    training.__dict__.update(run.__dict__)
    return training


def plan(
    source: HybridMDP | Training, start: PlaceLike | None = None, *, goal: PlaceLike | None = None, exact: bool = False
) -> "Plan":
    """A plan: the exact one of a model, or of a training what was learned unless ``exact``.

    Another goal than the model's own is always solved exactly, since values learned for one goal say
    nothing of another.  Raises NoPlanError when no way leads there.
    """
    from qualrl.planning.planner import plan_exactly

    check_type("plan", source, HybridMDP | Training, "a HybridMDP or a Training, from qualrl.build or qualrl.train")
    model = source.model if isinstance(source, Training) else source
    if goal is not None and (other := _with_goal(model, goal)) is not None:
        state, name = start_of(other, start)
        notes = ["Note: another goal than was learned, so this plan is the exact one."] * isinstance(source, Training)
        return plan_exactly(other, state, (name, _name(goal)), notes=notes)
    if isinstance(source, Training) and not exact:
        return source.plan(start)
    state, name = start_of(model, start)
    solved = source.exact if isinstance(source, Training) else None
    return plan_exactly(model, state, (name, goal_name(model) if goal is None else _name(goal)), exact=solved)


def goal_name(model: HybridMDP) -> str:
    """What to call the goal: the region whose centre it is, or its cell, or "the goal" without a map."""
    return "the goal" if model.regions is None else _cell_name(model, model.grid.goal)


def check(
    regions: RegionMap,
    claims: Sequence[str],
    *,
    zones: Mapping[str, Sequence[tuple[float, float]]] | None = None,
    near_m: float = CUTS.near_m,
    far_m: float = CUTS.far_m,
) -> "Checked":
    """Claims in words, as "room A north of room B", checked against a map and against each other.

    zones: name -> corners (x, y) of a polygon, metres.  near_m, far_m: walks up to the first are near, longer ones than
    the second far.  Raises SettingError for a claim that cannot be read, and PlaceError for a zone without free cells.
    """
    from qualrl.qualitative import checking
    from qualrl.qualitative.statements import read_statement
    from qualrl.spatial.relations import Relations
    from qualrl.spatial.zones import zone_within

    check_type("check", regions, RegionMap, "a RegionMap, from qualrl.segment")
    drawn = [zone_within(name, corners, regions) for name, corners in (zones or {}).items()]
    cuts = DistanceCuts(near_m, far_m)
    return checking.check(
        Relations(regions, drawn),
        [read_statement(claim) for claim in ([claims] if isinstance(claims, str) else claims)],
        cuts,
    )


def _with_goal(model: HybridMDP, goal: PlaceLike) -> HybridMDP | None:
    """The same model with another goal; None when it is the same one."""
    if model.regions is None:
        raise SettingError("another goal needs a model with a map")
    world = model.grid
    if model.state_at(read_place(goal)) == world.goal:
        return None
    start = None if model.start is None else read_place(model.cell_of(model.start))
    other = hybrid_mdp(
        model.regions, read_place(goal), start=start, gamma=world.gamma, slip=world.slip,
        directions=world.directions, step_reward=world.step_reward, goal_reward=world.goal_reward,
    )  # fmt: skip
    return replace(other, world=replace(other.grid, closed=world.closed), coarser=model.coarser)


def start_of(model: HybridMDP, start: PlaceLike | None) -> tuple[int, str]:
    """State and name of a start."""
    if start is None:
        if model.start is None:
            raise SettingError(
                "say where to start, by --from or a start of the scenario: this model has none of its own"
            )
        return model.start, _cell_name(model, model.start) if model.regions else model.describe(model.start)
    if isinstance(start, int):
        if not 0 <= start < len(model):
            raise SettingError(f"there are states 0 to {len(model) - 1}, got {start}")
        return start, model.describe(start)
    return model.state_at(read_place(start)), _name(start)


def _name(place: PlaceLike) -> str:
    return str(read_place(place))


def _cell_name(model: HybridMDP, state: int) -> str:
    """The name of a place at a state's cell, or else the cell itself."""
    assert model.regions is not None
    cell = model.cell_of(state)
    for region in model.regions.regions:
        if region.centre == cell:
            return region.name
    return f"row {cell[0]}, column {cell[1]} in {model.region_names[model.region_of[state]]}"


def farthest_start(model: HybridMDP) -> str:
    """The region whose centre is the longest walk from the goal: where to plan from when no start is given."""
    if model.regions is None:
        raise SettingError("a model without a map has no walks; say where to start")
    world = model.grid
    regions = model.regions.regions
    return max(regions, key=lambda region: int(world.steps_to_goal[world.state_of[region.centre]])).name
