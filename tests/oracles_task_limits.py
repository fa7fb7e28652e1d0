"""What hierarchical learners tend to: dynamic programming over what each may choose, written for clarity."""

import numpy as np


def settled(backed_up, values, sweeps=3000):
    """Values that a backup no longer changes; what backed_up(values) returns is a dictionary with the same keys."""
    for _ in range(sweeps):
        new = backed_up(values)
        if max(np.abs(new[key] - values[key]).max() for key in values) < 1e-12:
            break
        values = new
    return new


def best_over_options(marks, chance, reward, gamma, primitives):
    """{(s, choice): value} of options and moves, by value iteration over what each does until it ends."""
    choices = marks.choices(primitives)
    n = len(choices)
    pays, ends = {}, {}
    for option in marks.options:
        inside = [s for s in range(n) if marks.may(option, s)]
        moves = [marks.move(option, s) for s in inside]
        on = gamma * chance[inside, moves]
        stays = np.linalg.inv(np.eye(len(inside)) - on[:, inside])
        on[:, inside] = 0.0
        pays |= {(s, option): gain for s, gain in zip(inside, stays @ reward[inside, moves], strict=True)}
        ends |= {(s, option): row for s, row in zip(inside, stays @ on, strict=True)}
    for s in range(n):
        pays |= {(s, a): reward[s, a] for a in range(reward.shape[1])}
        ends |= {(s, a): gamma * chance[s, a] for a in range(reward.shape[1])}

    def backed_up(values):
        best = np.array([max((values[s, c] for c in found), default=0.0) for s, found in enumerate(choices)])
        return {key: pays[key] + ends[key] @ best for key in values}

    return settled(backed_up, {(s, c): 0.0 for s, found in enumerate(choices) for c in found})


def best_machine(marks, chance, reward, gamma, primitives):
    """{(s, choice): value} at the top of the best policy of the machine, by value iteration over (s, what runs)."""
    choices = marks.choices(primitives)
    n = len(choices)
    inside = {(s, o): marks.no_farther(o, s) for s in range(n) for o in marks.open(s)}

    def backed_up(values):
        best = np.array([max((values[s, c] for c in found), default=0.0) for s, found in enumerate(choices)])
        new = {}
        for o in [None, *marks.options]:
            after = best if o is None else np.array([values[t, o] if (t, o) in inside else best[t] for t in range(n)])
            worth = reward + gamma * chance @ after
            new |= {(s, a): worth[s, a] for s, a in values if isinstance(a, int)} if o is None else {}
            new |= {key: worth[key[0], moves].max() for key, moves in inside.items() if key[1] == o}
        return new

    return settled(
        backed_up, {(s, c): 0.0 for s, found in enumerate(choices) for c in found} | dict.fromkeys(inside, 0.0)
    )


def best_of_agents(marks, chance, reward, gamma, worst=None):
    """{(option, s): (A,) values} of sub-agents' own tasks: paid 1 on arriving, or, given worst, as w-learning pays."""
    n, moves = reward.shape
    homes = [marks.open(s) for s in range(n)]

    def backed_up(values):
        hopes = {key: own.max() for key, own in values.items()}
        worth = [0.0 if marks.terminal(t) else max((hopes[o, t] for o in homes[t]), default=worst) for t in range(n)]
        new = {}
        for option in marks.options:
            arrived = np.array([mark == option[1] for mark in marks.mark_of])
            on = np.array([hopes.get((option, t), 0.0 if worst is None else worst) for t in range(n)])
            if worst is None:
                target = chance @ np.where(arrived, 1.0, gamma * on)
            else:
                over = arrived | [marks.terminal(t) for t in range(n)]
                target = reward + gamma * chance @ np.where(over, np.array(worth, float), on)
            new |= {(o, s): target[s] for o, s in values if o == option}
        return new

    return settled(backed_up, {(o, s): np.zeros(moves) for s in range(n) for o in homes[s]})


def best_switch(marks, chance, reward, gamma, primitives, of_ties=max):
    """{(s, choice): value} of obeying sub-agents, who do what is best for their own tasks, or making a move.

    of_ties: max or min of what moves are worth that are as good for a sub-agent.
    """
    choices = marks.choices(primitives)
    moves = {(s, a): [a] for s, found in enumerate(choices) for a in found if isinstance(a, int)}
    for (option, s), own in best_of_agents(marks, chance, reward, gamma).items():
        moves[s, option] = np.flatnonzero(own > own.max() - 1e-9)

    def backed_up(values):
        best = np.array([max((values[s, c] for c in found), default=0.0) for s, found in enumerate(choices)])
        worth = reward + gamma * chance @ best
        return {(s, c): of_ties(worth[s, tied]) for (s, c), tied in moves.items()}

    return settled(backed_up, dict.fromkeys(moves, 0.0))


def recursive_optimum(tasks, chance, reward, gamma, epsilon=0.0, name="root"):
    """({(s, call): value to the task's own choice}, (S,) value to others, (S, S) discounted chance of where it ends).

    Every task does its own best, given what those it calls do; tasks as for Maxq.  With an epsilon, what is called
    ends where exploring takes it, though it is valued as if it did its best: to that MAXQ-Q with that epsilon tends.
    """
    n = len(reward)
    open_calls = [[c for c in tasks[name]["calls"] if tasks[name]["may"](c, s)] for s in range(n)]
    worth, ends = {}, {}
    for call in {c for found in open_calls for c in found}:
        if isinstance(call, int):
            worth[call], ends[call] = reward[:, call], gamma * chance[:, call]
        else:
            _, worth[call], ends[call] = recursive_optimum(tasks, chance, reward, gamma, epsilon, call)

    def backed_up(values):
        found = enumerate(open_calls)
        best = np.array([max(values[s, c] for c in cs) if cs else tasks[name]["pseudo"](s) for s, cs in found])
        return {(s, c): worth[c][s] + ends[c][s] @ best for s, c in values}

    values = settled(backed_up, {(s, c): 0.0 for s, found in enumerate(open_calls) for c in found})
    active = np.array([bool(found) for found in open_calls])
    gain, on, wandering = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
    for s in np.flatnonzero(active):
        best = max(open_calls[s], key=lambda c: values[s, c])
        gain[s], on[s] = worth[best][s], ends[best][s]
        wandering[s] = (1 - epsilon) * on[s] + epsilon * np.mean([ends[c][s] for c in open_calls[s]], axis=0)
    seen = np.linalg.solve(np.eye(n) - on * active, gain)
    return values, seen, np.linalg.solve(np.eye(n) - wandering * active, wandering * ~active)
