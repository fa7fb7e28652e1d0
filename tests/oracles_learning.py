"""Slow textbook twins of the learners with traces and of those that plan; see ``oracles`` for Algorithms 1 and 2.

Every twin draws from ``oracles.xoshiro`` in the order that the trainer documents: start (if there are several), choice,
outcome, and whatever is replayed.  step(state, action, draws) -> (next state, reward, number of the outcome);
alpha is a function of k, the number of earlier updates of the same state and action.
"""

import math
from collections import defaultdict

import numpy as np

from tests.oracles import xoshiro


def start_of(starts, draws):
    return starts[0] if len(starts) == 1 else starts[((next(draws) & 0xFFFFFFFF) * len(starts)) >> 32]


def epsilon_greedy(values, epsilon, draws):
    """An action; the high half of one draw decides whether to explore, the low half which action it is."""
    u = next(draws)
    if (u >> 32) < int(epsilon * 2**32):
        return ((u & 0xFFFFFFFF) * len(values)) >> 32
    best = [a for a, value in enumerate(values) if value == max(values)]
    return best[((u & 0xFFFFFFFF) * len(best)) >> 32]


def temporal_differences(
    step, terminal, starts, n_states, n_actions, *, policy, gamma, alpha, epsilon, episodes, seed, max_steps
):
    """TD(0) (Sutton and Barto, section 6.1) for a policy {state: action}, other states acting at random.

    Returns (V, steps, returns).
    """
    draws, value, updates = xoshiro(seed), [0.0] * n_states, defaultdict(int)
    all_steps, all_returns = [], []
    for _ in range(episodes):
        s, t, total, over = start_of(starts, draws), 0, 0.0, False
        while not over and t < max_steps:
            u = next(draws)
            a = ((u & 0xFFFFFFFF) * n_actions) >> 32
            if (u >> 32) >= int(epsilon * 2**32):
                a = policy.get(s, a)
            s2, reward, _ = step(s, a, draws)
            over = terminal(s2)
            value[s] += alpha(updates[s]) * ((reward if over else reward + gamma * value[s2]) - value[s])
            updates[s] += 1
            s, t, total = s2, t + 1, total + reward
        all_steps.append(t)
        all_returns.append(total)
    return value, all_steps, all_returns


def with_traces(
    step, terminal, starts, n_states, n_actions, *, watkins, trace, gamma, alpha, epsilon, episodes, seed, max_steps,
    q0=None, most=math.inf,
):  # fmt: skip
    """SARSA(lambda) and Watkins's Q(lambda) with replacing traces (Sutton and Barto 1998, figures 7.11 and 7.14).

    All traces are kept in a dictionary and all of them are updated at every step; a row keeps the alpha of its visit.
    trace = 0 gives SARSA.  Values start at q0, or at 0; the run breaks off after ``most`` steps.
    Returns (q, steps, returns).
    """
    draws, updates = xoshiro(seed), defaultdict(int)
    q = [[0.0] * n_actions for _ in range(n_states)] if q0 is None else [list(values) for values in q0]
    all_steps, all_returns = [], []
    for _ in range(episodes):
        s, t, total, over = start_of(starts, draws), 0, 0.0, False
        eligible = {}
        a = epsilon_greedy(q[s], epsilon, draws)
        while not over and t < max_steps:
            if sum(all_steps) + t >= most:
                return q, all_steps, all_returns
            rate = alpha(updates[s, a])
            updates[s, a] += 1
            s2, reward, _ = step(s, a, draws)
            over = terminal(s2)
            error, a2, exploring = reward - q[s][a], None, False
            if not over:
                a2 = epsilon_greedy(q[s2], epsilon, draws)
                exploring = q[s2][a2] < max(q[s2])
                error += gamma * (max(q[s2]) if watkins else q[s2][a2])
            eligible[s, a] = (1.0, rate)
            for (i, b), (share, rate_then) in eligible.items():
                q[i][b] += rate_then * error * share
            if watkins and exploring:
                eligible = {}
            eligible = {row: (gamma * trace * share, rate_then) for row, (share, rate_then) in eligible.items()}
            s, a, t, total = s2, a2, t + 1, total + reward
        all_steps.append(t)
        all_returns.append(total)
    return q, all_steps, all_returns


def dyna_q(
    step, terminal, starts, n_states, n_actions, *, planning_steps, gamma, alpha, epsilon, episodes, seed, max_steps,
    order=None,
):  # fmt: skip
    """Dyna-Q (Sutton and Barto, section 8.2), its model the outcomes seen, drawn as often as they were seen.

    order: the outcomes of a row from which to draw, first to last; None = the only one seen last, without a draw.
    Planning updates use the alpha of the row's real updates.  Returns (q, steps, returns).
    """
    draws, updates, tried = xoshiro(seed), defaultdict(int), []
    q = [[0.0] * n_actions for _ in range(n_states)]
    seen = defaultdict(lambda: defaultdict(int))
    result = {}
    all_steps, all_returns = [], []

    def learn(s, a, s2, reward, k):
        target = reward if terminal(s2) else reward + gamma * max(q[s2])
        q[s][a] += alpha(k) * (target - q[s][a])

    for _ in range(episodes):
        s, t, total, over = start_of(starts, draws), 0, 0.0, False
        while not over and t < max_steps:
            a = epsilon_greedy(q[s], epsilon, draws)
            s2, reward, outcome = step(s, a, draws)
            over = terminal(s2)
            if (s, a) not in seen:
                tried.append((s, a))
            seen[s, a][outcome] += 1
            result[s, a, outcome] = (s2, reward)
            learn(s, a, s2, reward, updates[s, a])
            updates[s, a] += 1
            for _ in range(planning_steps):
                i, b = tried[((next(draws) & 0xFFFFFFFF) * len(tried)) >> 32]
                if order is None:
                    drawn = outcome_of_only(seen[i, b])
                else:
                    urn = [o for o in order(i, b) for _ in range(seen[i, b][o])]
                    drawn = urn[int((next(draws) >> 11) / 2**53 * len(urn))]
                learn(i, b, *result[i, b, drawn], updates[i, b])
            s, t, total = s2, t + 1, total + reward
        all_steps.append(t)
        all_returns.append(total)
    return q, all_steps, all_returns


def outcome_of_only(counts):
    (only,) = counts
    return only


class BinaryHeap:
    """The textbook's array heap (Cormen et al., chapter 6), largest on top; equals stay where they are."""

    def __init__(self):
        self.keys, self.items = [], []

    def swap(self, i, j):
        self.keys[i], self.keys[j] = self.keys[j], self.keys[i]
        self.items[i], self.items[j] = self.items[j], self.items[i]

    def raise_to(self, item, key):
        """Put an item in, or raise its key; a smaller key than it has is ignored."""
        if item not in self.items:
            self.items.append(item)
            self.keys.append(-1.0)
        i = self.items.index(item)
        if key <= self.keys[i]:
            return
        self.keys[i] = key
        while i > 0 and self.keys[(i - 1) // 2] < self.keys[i]:
            self.swap(i, (i - 1) // 2)
            i = (i - 1) // 2

    def take(self):
        """The item on top."""
        self.swap(0, -1)
        top = self.items.pop()
        self.keys.pop()
        i = 0
        while True:
            below = [j for j in (2 * i + 1, 2 * i + 2) if j < len(self.keys)]
            if not below or max(self.keys[j] for j in below) <= self.keys[i]:
                return top
            largest = max(below, key=lambda j: (self.keys[j], -j))
            self.swap(i, largest)
            i = largest


def prioritized_sweeping(
    step, terminal, starts, n_states, n_actions, *, planning_steps, threshold, gamma, epsilon, episodes, seed,
    max_steps, before, certain,
):  # fmt: skip
    """Prioritized sweeping (Moore and Atkeson 1993), a state at a time, every action of it that was tried.

    before: the states s' that may follow, in the order in which their predecessors are looked at: {s': [(s, a,
    outcome)]}.  certain: every action has one outcome.  Returns (q, steps, returns).
    """
    draws, heap = xoshiro(seed), BinaryHeap()
    q = [[0.0] * n_actions for _ in range(n_states)]
    value = [0.0] * n_states
    seen = defaultdict(dict)
    tries = defaultdict(int)
    all_steps, all_returns = [], []

    def backup(s, a):
        if certain:  # nothing to average
            ((_, s2, reward),) = seen[s, a].values()
            return reward + gamma * value[s2]
        total = 0.0  # one after the other: from Python 3.12 on sum() rounds less than a loop does
        for _, (n, s2, reward) in sorted(seen[s, a].items()):
            total += n * (reward + gamma * value[s2])
        return total / tries[s, a]

    for _ in range(episodes):
        s, t, total, over = start_of(starts, draws), 0, 0.0, False
        while not over and t < max_steps:
            a = epsilon_greedy(q[s], epsilon, draws)
            s2, reward, outcome = step(s, a, draws)
            over = terminal(s2)
            tries[s, a] += 1
            n = seen[s, a][outcome][0] if outcome in seen[s, a] else 0
            seen[s, a][outcome] = (n + 1, s2, reward)
            change = abs(backup(s, a) - q[s][a])
            if change > threshold:
                heap.raise_to(s, change)
            for _ in range(planning_steps):
                if not heap.items:
                    break
                x = heap.take()
                for b in range(n_actions):
                    if tries[x, b]:
                        q[x][b] = backup(x, b)
                change = abs(max(q[x]) - value[x])
                value[x] = max(q[x])
                for i, b, o in before.get(x, []):
                    if o in seen[i, b] and gamma * change * seen[i, b][o][0] / tries[i, b] > threshold:
                        heap.raise_to(i, gamma * change * (seen[i, b][o][0] / tries[i, b]))
            s, t, total = s2, t + 1, total + reward
        all_steps.append(t)
        all_returns.append(total)
    return q, all_steps, all_returns


class DenseMDP:
    """Any MDP as full matrices: p (S, A, S), r (S, A) expected, terminal (S,), known (S, A) = may be chosen."""

    def __init__(self, p, r, terminal, gamma, known=None):
        self.p, self.r, self.terminal, self.gamma = p, r, np.asarray(terminal), gamma
        self.known = np.ones(r.shape, bool) if known is None else known

    @classmethod
    def of_outcomes(cls, n_states, n_actions, outcomes, terminal, gamma):
        """outcomes(s, a) -> [(probability, next state, reward)]"""
        p, r = np.zeros((n_states, n_actions, n_states)), np.zeros((n_states, n_actions))
        for s in range(n_states):
            for a in range(n_actions):
                for share, s2, reward in outcomes(s, a):
                    p[s, a, s2] += share
                    r[s, a] += share * reward
        return cls(p, r, [terminal(s) for s in range(n_states)], gamma)

    def after(self, value):
        """(S, A) values of the actions when what follows is worth ``value`` (S,), terminal states 0."""
        return self.r + self.gamma * self.p @ np.where(self.terminal, 0.0, value)

    def solve(self, weights):
        """V of a policy given by the share of each action (S, A): one linear solve."""
        p = np.einsum("sa,sat->st", weights, self.p) * ~self.terminal
        r = (weights * self.r).sum(axis=1)
        p[self.terminal], r[self.terminal] = 0.0, 0.0
        return np.linalg.solve(np.eye(len(r)) - self.gamma * p, r)

    def optimal(self, lowest=0.0, epsilon=0.0):
        """Q (S, A) of the best policy that takes a random action with probability epsilon: policy iteration.

        Unknown actions are worth ``lowest`` and lead nowhere.
        """
        n_states, n_actions = self.r.shape
        p, r = np.where(self.known[:, :, None], self.p, 0.0), np.where(self.known, self.r, lowest)
        mdp = DenseMDP(p, r, self.terminal, self.gamma)
        choice = np.zeros(n_states, int)
        for _ in range(1000):
            weights = np.full((n_states, n_actions), epsilon / n_actions)
            weights[np.arange(n_states), choice] += 1 - epsilon
            q = mdp.after(mdp.solve(weights))
            better = q.max(axis=1) > q[np.arange(n_states), choice] + 1e-12 * np.abs(q).max()
            if not (better & ~self.terminal).any():
                q[self.terminal] = 0.0
                return q
            choice = np.where(better, q.argmax(axis=1), choice)
        raise AssertionError("policy iteration did not settle")
