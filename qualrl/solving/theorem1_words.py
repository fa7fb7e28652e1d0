"""The audit of Theorem 1 in plain words, every claim with its numbers."""

from qualrl.solving.theorem1 import Abstraction, Counterexample, Entry, Refined, Theorem1Audit


def explained(audit: Theorem1Audit) -> str:
    """What was found, in a few lines."""
    slip = f", slip {audit.slip:g}" if audit.slip else ""
    lines = [
        f"Theorem 1, {_count(audit.parts, audit.kind)}, gamma {audit.gamma:g}{slip}: "
        + (_equal(audit) if audit.blind.holds else "a counterexample.")
    ]
    if audit.blind.counterexample is not None:
        lines += _against(audit.blind.counterexample, audit.blind, audit)
    lines += ["", *_by_door(audit), *_refined(audit.refined, audit)]
    if audit.start is not None and audit.start_values is not None:
        flat, folded = audit.start_values
        lines.append(f"Value of the start, {audit.start}: {flat:.6g} flat, {folded:.6g} as semi-MDP.")
    return "\n".join(lines)


def _equal(audit: Theorem1Audit) -> str:
    at = f" (at {audit.blind.where})" if audit.blind.states else ""
    return (
        f"equal. However a {audit.kind} is entered, each of its actions has one law; the largest difference between "
        f"the value of a {audit.kind} and the exact value of an entry is {audit.blind.largest_error:.2g}{at}."
    )


def _against(found: Counterexample, blind: Abstraction, audit: Theorem1Audit) -> list[str]:
    one, other = found.first, found.second
    return [
        f'What "{found.action}" does in {found.group} depends on where {found.group} was entered:',
        f"  {_entry(one, audit.gamma)}",
        f"  {_entry(other, audit.gamma)}",
        f"The exact values of these two are {one.value:.6g} and {other.value:.6g}.",
        f"One state {found.group!r}, its entries all counting alike, is worth {found.value:.6g}: wrong by "
        f"{found.error:.4g}. However they are weighed, it is worth {found.least:.6g} to {found.greatest:.6g}.",
        f"{blind.laws_differ} of the {blind.pairs} pairs of a {audit.kind} and an action are like that. The largest "
        f"error of a value is {blind.largest_error:.4g}, at {blind.where}.",
    ]


def _entry(entry: Entry, gamma: float) -> str:
    if entry.mean_steps is None:
        law = f"E[gamma^tau] = {entry.discount:.6g}, and it may never end"
    elif entry.is_certain:
        steps = round(entry.mean_steps)
        law = f"{_count(steps, 'step')}, discount {gamma:g}^{steps} = {entry.discount:.6g}"
    else:
        law = (
            f"{entry.mean_steps:.6g} steps on average, E[gamma^tau] = {entry.discount:.6g} "
            f"(not gamma^E[tau] = {gamma**entry.mean_steps:.6g})"
        )
    return f"{entry.state}: {law}, reward {entry.reward:.6g}"


def _by_door(audit: Theorem1Audit) -> list[str]:
    found, what = audit.by_door, f"Refined to {audit.kind} and doorway ({_count(audit.by_door.states, 'state')}): "
    if found.holds:
        return [f"{what}exact."]
    some = found.counterexample
    text = (
        f"{what}not exact, as {found.laws_differ} of {found.pairs} pairs depend on the cell of the doorway. "
        f"The largest error of a value is {found.largest_error:.4g}, at {found.where}."
    )
    if some is None:
        return [text]
    one, other = some.first, some.second
    return [text, f'"{some.action}", for example:', *(f"  {_entry(entry, audit.gamma)}" for entry in (one, other))]


def _refined(found: Refined, audit: Theorem1Audit) -> list[str]:
    what = f"Refined to {audit.kind} and entry state ({_count(found.states, 'state')}, {_count(found.arcs, 'arc')}): "
    if not found.holds:
        return [
            f"{what}NOT confirmed; the flat chain differs by {found.same_policy_difference:.2g} under the same policy, "
            f"and its equations are off by {found.residual:.2g}. Please report this map."
        ]
    same = (
        f"{what}exact. The flat chain has the same values under the same policy (largest difference "
        f"{found.same_policy_difference:.1g}, and its one-step equations hold to {found.residual:.1g})"
    )
    if found.reaches_optimum:
        return [f"{same}, and they are the flat optimum (largest relative difference {found.relative_gap:.1g})."]
    return [
        f"{same}. The flat optimum is better, by up to {found.flat_gap:.4g} at {found.where}: after a slip it may go "
        "on through another exit, while a qualitative action keeps to its own and shuns the others."
    ]


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"
