"""Results for people: tables and text on stdout."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console as RichConsole
from rich.table import Column, Table
from rich.text import Text

if TYPE_CHECKING:  # what a command has to print, it has loaded
    from qualrl.learning.growth import Growth
    from qualrl.learning.recovery import Recovery
    from qualrl.learning.run import LearningRun
    from qualrl.planning.plan import Plan
    from qualrl.spatial.region_map import RegionMap

MOST_ROWS = 40


class PipedConsole(RichConsole):
    """Whoever reads us may stop reading: rich would end with 1, which means something else here."""

    def on_broken_pipe(self) -> None:
        """See ``console.guarded``."""
        raise BrokenPipeError


def print_map(regions: "RegionMap") -> None:
    """Size, regions with areas, and doorways of a map."""
    grid = regions.grid
    height, width = grid.shape
    free = int(grid.free.sum())
    unknown = grid.unknown_cells
    out = PipedConsole(highlight=False)
    out.print(
        f"{grid.source or 'map'}: {width} x {height} cells of {grid.resolution_m:g} m "
        f"({width * grid.resolution_m:g} x {height * grid.resolution_m:g} m), "
        f"{free} free ({free * grid.resolution_m**2:.1f} m2), {unknown} unknown",
        markup=False, soft_wrap=True,
    )  # fmt: skip
    if grid.radius_m:
        out.print(f"free is where the centre of a robot with radius_m {grid.radius_m:g} can be", markup=False)
    if grid.origin != (0.0, 0.0, 0.0):
        x_m, y_m, yaw_rad = grid.origin
        out.print(f"lower-left corner at x {x_m:g} m, y {y_m:g} m, turned by {yaw_rad:g} rad", markup=False)
    _print_regions(out, regions)
    _print_doors(out, regions)
    lost = [name for name in regions.lost if not name.startswith("pocket ")]
    if lost:
        out.print(f"the robot is too large for: {', '.join(lost[:MOST_ROWS])}", markup=False, soft_wrap=True)
        _print_rest(out, len(lost), "places")
    counts: dict[str, int] = {}
    for mark in regions.landmarks:
        counts[mark.kind] = counts.get(mark.kind, 0) + 1
    out.print("landmarks: " + (", ".join(f"{count} {kind}" for kind, count in counts.items()) or "none"), markup=False)


def print_map_and_wings(regions: "RegionMap", wings: Mapping[str, Sequence[str]]) -> None:
    """A map as ``print_map`` shows it, then the wings that its regions form, if they form more than one."""
    print_map(regions)
    if len(wings) > 1:
        out = PipedConsole(highlight=False)
        for name, inside in list(wings.items())[:MOST_ROWS]:
            out.print(f"{name}: {', '.join(inside)}", markup=False, soft_wrap=True)
        _print_rest(out, len(wings), "wings")


def _table(title: str | None, words: Sequence[str], numbers: Sequence[str]) -> Table:
    """An empty table; words too long for a column go on in the next line and do not end in dots, numbers stay whole."""
    columns = [Column(heading, overflow="fold") for heading in words]
    columns += [Column(heading, overflow="fold", justify="right", no_wrap=True) for heading in numbers]
    return Table(*columns, title=title, title_justify="left")


def _print_regions(out: PipedConsole, regions: "RegionMap") -> None:
    named = [region for region in regions.regions if region.kind != "pocket"]
    numbers = ("area\n(m2)", "cells", "centre\nrow,col", "doors")
    table = _table(f"{len(named)} regions", ("region", "kind"), numbers)
    for index, region in enumerate(named[:MOST_ROWS]):
        doors = sum(index in door.pair for door in regions.doorways)
        row, column = region.centre
        table.add_row(
            Text(region.name), region.kind, f"{region.area_m2:.2f}", str(region.cells), f"{row},{column}", str(doors)
        )
    out.print(table)
    _print_rest(out, len(named), "regions")
    pockets = [region for region in regions.regions if region.kind == "pocket"]
    if pockets:
        area_m2 = sum(region.area_m2 for region in pockets)
        out.print(f"and {len(pockets)} pockets of free cells that lead nowhere ({area_m2:.2f} m2 together)")


def _print_doors(out: PipedConsole, regions: "RegionMap") -> None:
    if not regions.doorways:
        out.print("no doorways")
        return
    numbers = ("width\n(m)", "middle\nrow,col", "middle\nx,y (m)")
    table = _table(f"{len(regions.doorways)} doorways", ("doorway", "between", "and"), numbers)
    names = regions.region_names
    for door in regions.doorways[:MOST_ROWS]:
        row, column = door.midpoint
        x_m, y_m = regions.grid.to_world(row, column)
        table.add_row(
            Text(door.name), Text(names[door.pair[0]]), Text(names[door.pair[1]]), f"{door.width_m:.2f}",
            f"{row},{column}", f"{x_m:.2f},{y_m:.2f}",
        )  # fmt: skip
    out.print(table)
    _print_rest(out, len(regions.doorways), "doorways")


def _print_rest(out: PipedConsole, count: int, what: str) -> None:
    if count > MOST_ROWS:
        out.print(f"and {count - MOST_ROWS} more {what} (--json lists all)")


def print_learning(run: "LearningRun") -> None:
    """How a run went, beside the optimum."""
    from qualrl.planning.plan import in_steps

    learned = "does not reach the goal yet" if run.greedy_steps is None else in_steps(run.greedy_steps)
    lines = [
        f"{run.algorithm}: {len(run.steps)} episodes with seed {run.seed}, "
        f"{run.total_steps:,} steps in {run.seconds:.1f} s"
    ]
    if run.model.start is not None:
        if run.chooses:
            optimum = "no way" if run.optimal_steps is None else in_steps(run.optimal_steps)
            lines.append(f"learned policy: {learned}; optimum: {optimum}")
        learned_value, exact = run.q[run.model.start].max(), run.exact_values[run.model.start]
        lines.append(f"value of the start: {learned_value:.6g} learned, {exact:.6g} exact")
    lines.append(f"largest error of any state's value, those hardly visited included: {run.max_error:.4g}")
    lines += [_recovered(recovery) for recovery in run.recovery]
    out = PipedConsole(highlight=False)
    out.print("\n".join(lines), markup=False, soft_wrap=True)
    if run.growth is not None and run.knew_map is not None:
        _print_growth(out, run.growth)
        out.print(_beside(run, run.knew_map), markup=False, soft_wrap=True)


def _recovered(of: "Recovery") -> str:
    optimum = "" if of.optimum_after is None else f" (optimum {of.optimum_before} -> {of.optimum_after} steps)"
    took = _took(of.episodes, of.steps)
    fresh = _took(of.fresh_episodes, of.fresh_steps)
    return f"after episode {of.after} {of.what}{optimum}: recovered {took}; a learner starting from nothing: {fresh}"


def _took(episodes: int | None, steps: int | None) -> str:
    many = "" if episodes == 1 else "s"
    return "not at all" if episodes is None else f"after {episodes} episode{many}, {steps:,} steps"


def _print_growth(out: PipedConsole, growth: "Growth") -> None:
    numbers = ("steps", "episode", "cells", "known", "regions", "doors", "marks", "goal seen")
    table = _table("the map as it became known", (), numbers)
    for stage in growth.stages:
        table.add_row(
            f"{stage.steps:,}", str(stage.episode), f"{stage.known_cells:,}",
            f"{stage.known_cells / growth.free_cells:.0%}", str(stage.regions), str(stage.doorways),
            str(stage.landmarks), "yes" if stage.knows_goal else "no",
        )  # fmt: skip
    out.print(table)


def _beside(run: "LearningRun", knew: "LearningRun") -> str:
    from qualrl.planning.plan import in_steps

    def told(of: "LearningRun") -> str:
        policy = "none to the goal" if of.greedy_steps is None else in_steps(of.greedy_steps)
        return f"first episode {of.steps[0]:,} steps, all {of.total_steps:,} in {of.seconds:.1f} s, policy {policy}"

    return f"without the map: {told(run)}\nknowing the map: {told(knew)}"


def print_learners(rows: Sequence[Mapping[str, str]]) -> None:
    """The learners, one a row."""
    table = _table(None, ("learner", "what it is", "its values converge to", "source"), ())
    table.show_lines = True
    table.columns[0].no_wrap = True  # a name to be copied
    for row in rows:
        table.add_row(row["name"], row["title"], row["limit"], row["source"])
    PipedConsole(highlight=False).print(table)


def print_plan(plan: "Plan") -> None:
    """A plan in words."""
    PipedConsole(highlight=False).print(plan.explain(), markup=False, soft_wrap=True)


def print_files(folder: Path, names: list[str]) -> None:
    """What was written."""
    PipedConsole(highlight=False).print(f"written to {folder}: {', '.join(names)}", markup=False, soft_wrap=True)
