"""``qualrl reproduce``: each figure of the paper measured again, and what the paper says of it judged."""

import contextlib
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet

if TYPE_CHECKING:
    from qualrl.io.output_folder import OutputFolder
    from qualrl.studies.study import Study

ALL = "all"
TABLE_FILE = "table.md"
UNTIL = "Until convergence, medians (95 % of the runs)"
MEASURED = f"{UNTIL}; before, after: mean steps an episode"


@guarded
def reproduce(
    figure: Annotated[str, typer.Argument(metavar="FIGURE", help="fig7 to fig13, law, taxi, or all.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder for the results [default: results/reproduce/FIGURE]."
        ),
    ] = None,
    seeds: Annotated[
        int | None, typer.Option("--seeds", min=2, max=10_000, help="Runs of each kind, with seeds 0, 1, ... [30].")
    ] = None,
    threads: Annotated[
        int | None, typer.Option("--threads", min=1, max=1000, help="Runs at a time [as many as processors].")
    ] = None,
    episodes: Annotated[int | None, typer.Option("--episodes", min=1, max=100_000, hidden=True)] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Measure a figure of the paper again: what the paper says, what was measured, and a verdict.

    Exit code 0 also when a claim is not reproduced: that is a finding.
    """
    from qualrl.commands.documents import file_list
    from qualrl.io.output_folder import OutputFolder
    from qualrl.studies.study import prepared, run_study

    console = Console(as_json, quiet)
    names = _names(figure, console)
    ready = [prepared(name, seeds) for name in names]
    target = output or Path("results") / "reproduce" / figure
    ours = [TABLE_FILE, *(f"{name}.{ending}" for name in names for ending in ("json", "png"))]
    with OutputFolder(target, ours=ours) as folder:
        studies = []
        with _progress(console, sum(study.n_runs for study in ready)) as watch:
            for study in ready:
                studies.append(run_study(study, episodes=episodes, threads=threads, watch=watch(study.name)))
        with console.stage("drawing"):
            documents, files = _write(folder, studies)
    document = documents[0] if figure != ALL else _whole(documents)
    document["files"] = file_list(target, files)

    def for_people() -> None:
        from qualrl.commands.tables import print_files

        _print(studies)
        print_files(target, files)

    console.result(document, for_people)


def _names(figure: str, console: Console) -> tuple[str, ...]:
    """The studies asked for; of all, the taxi only with what it needs."""
    from qualrl.io.gymnasium_world import MISSING, has_gymnasium
    from qualrl.studies.settings import NEED_GYMNASIUM, STUDIES

    if figure != ALL:
        return (figure,)
    if has_gymnasium():
        return STUDIES
    for name in NEED_GYMNASIUM:
        console.note(f"{name} is left out: {MISSING}")
    return tuple(name for name in STUDIES if name not in NEED_GYMNASIUM)


def _write(folder: "OutputFolder", studies: "list[Study]") -> tuple[list[dict[str, Any]], list[str]]:
    """JSON and picture of each study, and the table of all.  Returns documents and names of files."""
    from qualrl.studies.document import report, study_document
    from qualrl.studies.pictures import draw_study

    documents, files = [], []
    for study in studies:
        document = study_document(study)
        folder.path(f"{study.name}.json").write_text(json.dumps(document, allow_nan=False) + "\n", encoding="utf-8")
        drawn = draw_study(study, folder.path(f"{study.name}.png"))
        documents.append(document)
        files += [f"{study.name}.json", *([f"{study.name}.png"] if drawn else [])]
    folder.path(TABLE_FILE).write_text(report(studies), encoding="utf-8")
    return documents, [*files, TABLE_FILE]


def _whole(documents: list[dict[str, Any]]) -> dict[str, Any]:
    claims = [{"figure": each["figure"], **claim} for each in documents for claim in each["claims"]]
    return {"qualrl": documents[0]["qualrl"], "claims": claims, "studies": documents}


@contextlib.contextmanager
def _progress(console: Console, total: int) -> Iterator[Callable[[str], Callable[[int], None] | None]]:
    """A bar over all runs on stderr, for someone who watches: a function from a study to its own watch."""
    if console.quiet or not sys.stderr.isatty():
        yield lambda name: None
        return
    from rich.console import Console as RichConsole
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("run"), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), console=RichConsole(file=sys.stderr), transient=True) as bar:
        task = bar.add_task("", total=total)

        def of(name: str) -> Callable[[int], None]:
            before = bar.tasks[0].completed
            bar.update(task, description=name)
            return lambda done: bar.update(task, completed=before + done)

        yield of


def _print(studies: "list[Study]") -> None:
    """The table of claims; of a single study also the table of what was measured."""
    from rich.table import Table
    from rich.text import Text

    from qualrl.commands.tables import PipedConsole
    from qualrl.studies.document import HEADINGS, claim_rows, measured_table, remarks

    out = PipedConsole(highlight=False)
    claims = Table(show_lines=True, expand=True)
    for heading, ratio in zip(HEADINGS, (None, 5, 6, 4), strict=True):
        claims.add_column(heading, ratio=ratio)
    for study in studies:
        for row in claim_rows(study):
            claims.add_row(*map(Text, row))
    out.print(claims)
    headings, measured = measured_table(studies[0])
    if len(studies) == 1 and measured:
        title = MEASURED if studies[0].course is None else UNTIL
        table = Table(*headings, title=title, title_justify="left", title_style="", box=None, padding=(0, 2, 0, 0))
        for cells in measured:
            table.add_row(*map(Text, cells))
        out.print(table)
    out.print(remarks(studies), markup=False, soft_wrap=True)
