"""Whether a learning rate meets Theorem 2: sum alpha_k = infinity and sum alpha_k**2 < infinity.

alpha_k is the value of a formula at k = 0, 1, 2, ...; that finitely many of them have no value (1/k at 0) or are
negative does not matter to a sum's convergence, and is not looked at here.  How it is decided stands in
``bertrand``: exact limits, with a certificate and a second look.  What it cannot decide it calls undecided.

A proof runs in a process of its own (about 1 s to start), because symbolic limits may take for ever: that process can
be ended anywhere, on every system, and from any thread.  It is a plain subprocess rather than one of
``multiprocessing``, which would run the caller's unguarded script a second time.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from qualrl.qualitative.expression import Number, evaluated
from qualrl.qualitative.formula import Formula

LIMIT_S = 20.0
START = "import sys; sys.path[:] = sys.argv[1:]; from qualrl.qualitative.proving import main; main()"


class Verdict(StrEnum):
    """What became of a claim."""

    PROVED = "proved"
    REFUTED = "refuted"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Convergence:
    """Whether a sum is finite."""

    converges: Verdict
    lines: tuple[str, ...]
    """The certificate: which exponent decides and what the sum is compared with; or why it is undecided."""


@dataclass(frozen=True)
class ScheduleProof:
    """Theorem 2's two conditions on a learning rate.  Parameters are positive; a verdict holds for all of them."""

    text: str
    sum_diverges: Verdict
    squares_converge: Verdict
    holds: Verdict
    """Both of them."""
    range: str
    """For which values of a parameter both hold, such as 1/2 < w <= 1; "" when that is not the answer."""
    sum_lines: tuple[str, ...]
    squares_lines: tuple[str, ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """The whole certificate."""
        return (
            *(f"sum of alpha_k: {line}" for line in self.sum_lines),
            *(f"sum of alpha_k**2: {line}" for line in self.squares_lines),
        )


@dataclass(frozen=True)
class _Finding:
    state: str  # converges for "all" parameters, for "some", for "none"; or "unknown"
    lines: tuple[str, ...]


def decide_convergence(formula: Formula, limit_s: float = LIMIT_S) -> Convergence:
    """Whether the sum of a formula's values over k is finite."""
    found = _findings(formula, ["sum"], limit_s)["sum"]
    return Convergence(_verdict(found.state, proved="all"), found.lines)


def robbins_monro(formula: Formula, limit_s: float = LIMIT_S) -> ScheduleProof:
    """Prove or refute both conditions of Theorem 2, within about ``limit_s`` seconds.

    The conditions are those of Robbins and Monro (1951).
    """
    found = _findings(formula, ["sum", "squares"], limit_s)
    diverges = _verdict(found["sum"].state, proved="none")
    converge = _verdict(found["squares"].state, proved="all")
    holds = Verdict.UNDECIDED
    common = found.get("range")
    if common:
        holds = _verdict(common.state, proved="all")
    elif Verdict.REFUTED in (diverges, converge):
        holds = Verdict.REFUTED
    elif diverges is converge is Verdict.PROVED:
        holds = Verdict.PROVED
    span = common.lines[0] if common else ""
    return ScheduleProof(formula.text, diverges, converge, holds, span, found["sum"].lines, found["squares"].lines)


def _verdict(state: str, proved: str) -> Verdict:
    """A state as a verdict on the claim that is proved in state ``proved`` ("all" or "none")."""
    if state not in ("all", "none"):
        return Verdict.UNDECIDED
    return Verdict.PROVED if state == proved else Verdict.REFUTED


def _findings(formula: Formula, parts: list[str], limit_s: float) -> dict[str, _Finding]:
    if not formula.names:
        return dict.fromkeys(parts, _of_constant(formula))
    request = json.dumps({"text": formula.text, "names": formula.names, "parts": parts})
    printed, problem = _asked(request, limit_s)
    found = {}
    for line in printed.splitlines():
        finding = json.loads(line)
        found[finding["part"]] = _Finding(finding["state"], tuple(finding["lines"]))
    missing = _Finding("unknown", (f"cannot decide: {problem}",))
    return dict.fromkeys(parts, missing) | found


def _of_constant(formula: Formula) -> _Finding:
    value = evaluated(formula.tree, {})
    exact = formula.tree.value if isinstance(formula.tree, Number) else formula.text
    if value > 0:
        return _Finding("none", (f"the term is {exact} at every k, not tending to 0: the sum diverges",))
    if value == 0:
        return _Finding("all", ("the term is 0 at every k: the sum is 0",))
    return _Finding("unknown", (f"cannot decide: a term of {exact} is negative",))


def _asked(request: str, limit_s: float) -> tuple[str, str]:
    """What the proving process printed, and why that may be less than all."""
    command = [sys.executable, "-P", "-c", START, *sys.path]
    try:
        done = subprocess.run(
            command, input=request, capture_output=True, text=True, encoding="utf-8", timeout=limit_s, check=False
        )
    except subprocess.TimeoutExpired as late:
        printed: Any = late.stdout or ""
        whole = printed.decode() if isinstance(printed, bytes) else printed
        return whole[: whole.rfind("\n") + 1], f"took longer than {limit_s:g} s"
    if done.returncode == 0:
        return done.stdout, "nothing was found"
    last = (done.stderr.strip() or "no reason given").splitlines()[-1]
    return done.stdout, f"the proving process ended early: {last}"
