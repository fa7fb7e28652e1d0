"""Slow textbook twins of the hierarchical learners: plain Python over dictionaries, and exact values by numpy.

They share no code with what they check.  A world is a function step(state, move, draws) -> (state, reward); what
moves most often do is likely[state][move].  Choices at the top are ("go", region, landmark) or a move's number.
"""

from collections import Counter, deque

import numpy as np

from tests.oracles import xoshiro

MASK32 = 0xFFFFFFFF


def likely_of(table):
    """Where each move of a table leads most often, the first of several."""
    rows = []
    for s in range(len(table)):
        row = []
        for a in range(table.n_actions):
            entries = range(*table.row_start[s * table.n_actions + a : s * table.n_actions + a + 2].tolist())
            row.append(int(table.target[max(entries, key=lambda e: (table.probability[e], -e))]))
        rows.append(row)
    return rows


class Landmarks:
    """Options between landmarks, found by one breadth-first search each."""

    def __init__(self, model, likely, terminal):
        self.likely, self.terminal = likely, terminal
        self.mark_of = model.landmarks.landmark_of.tolist()
        joined = model.landmarks.regions
        n = len(likely)
        self.regions_of = [
            {int(model.region_of[s]), *(joined[self.mark_of[s]] if self.mark_of[s] >= 0 else ())} for s in range(n)
        ]
        self.options = sorted({(g, mark) for mark, regions in enumerate(joined) for g in regions})
        self.steps = {option: self._search(*option) for option in self.options}

    def _search(self, region, mark):
        distance = {s: 0 for s in range(len(self.likely)) if self.mark_of[s] == mark}
        queue = deque(distance)
        while queue:
            t = queue.popleft()
            for s in range(len(self.likely)):
                if t in self.likely[s] and s not in distance and not self.terminal(s) and region in self.regions_of[s]:
                    distance[s] = distance[t] + 1
                    queue.append(s)
        return distance

    def may(self, option, s):
        return option[0] in self.regions_of[s] and self.steps[option].get(s, 0) > 0 and not self.terminal(s)

    def open(self, s):
        """Options that may be taken in s, in order."""
        return [option for option in self.options if self.may(option, s)]

    def move(self, option, s):
        """The first move of the shortest way."""
        nearer = self.steps[option][s] - 1
        return next(a for a, t in enumerate(self.likely[s]) if self.steps[option].get(t) == nearer)

    def no_farther(self, option, s):
        steps = self.steps[option]
        return [a for a, t in enumerate(self.likely[s]) if t != s and t in steps and steps[t] <= steps[s]]

    def leading(self):
        """Landmarks from all of whose states some option goes to one that leads on to the goal."""
        good = set()
        while True:
            now = set()
            for mark in set(self.mark_of) - {-1}:
                at = [s for s in range(len(self.likely)) if self.mark_of[s] == mark]
                if all(self.terminal(s) or any(o[1] in good for o in self.open(s)) for s in at):
                    now.add(mark)
            if now == good:
                return good
            good = now

    def choices(self, primitives):
        """The top choices of each state: options, then moves where they are offered."""
        good, moves = self.leading(), list(range(len(self.likely[0])))
        found = []
        for s in range(len(self.likely)):
            options = self.open(s)
            stuck = not any(o[1] in good for o in options)
            found.append([] if self.terminal(s) else options + (moves if primitives or stuck else []))
        return found


def explored(u, epsilon):
    return (u >> 32) < int(epsilon * 2**32)


def pick(values, u, epsilon):
    """A key of a dictionary: any when exploring, otherwise one of the best; draws as the kernels use them."""
    keys = list(values)
    if not explored(u, epsilon):
        best = max(values.values())
        keys = [key for key in keys if values[key] == best]
        if len(keys) == 1:
            return keys[0]
    return keys[((u & MASK32) * len(keys)) >> 32]


def beginning(starts, draws):
    return starts[0] if len(starts) == 1 else starts[((next(draws) & MASK32) * len(starts)) >> 32]


class Teacher:
    """Moves values towards their targets by rate(k), k counting what each of them was taught before."""

    def __init__(self, rate):
        self.rate, self.taught = rate, Counter()

    def next_rate(self, value):
        """The rate of a value, which is named by anything hashable, now that it is taught once more."""
        self.taught[value] += 1
        return self.rate(self.taught[value] - 1)

    def teach(self, values, key, target):
        """For dictionaries that live as long as the teacher does."""
        values[key] += self.next_rate((id(values), key)) * (target - values[key])


def learn_landmarks(how, step, marks, starts, *, gamma, rate, epsilon, episodes, seed, max_steps, primitives, worst):
    """option-q, intra-option-q, hamq, switch or w-learning; alpha of a value is rate(its updates so far).

    Returns (top values, inner values, steps, returns).
    """
    draws, teacher = xoshiro(seed), Teacher(rate)
    moves = range(len(marks.likely[0]))
    choices = marks.choices(primitives)
    if how == "w-learning":
        choices = [marks.open(s) or ([] if marks.terminal(s) else list(moves)) for s in range(len(choices))]
    top = [dict.fromkeys(found, 0.0) for found in choices]
    inner = {}
    for s in range(len(choices)):
        for option in marks.open(s):
            allowed = marks.no_farther(option, s) if how == "hamq" else moves
            inner[option, s] = dict.fromkeys(allowed, 0.0)
    run = {"option-q": run_option, "intra-option-q": run_option, "hamq": run_machine}.get(how, run_agents)
    all_steps, all_returns = [], []
    for _ in range(episodes):
        s = beginning(starts, draws)
        t, total = run(how, s, step, marks, top, inner, draws, gamma, teacher, epsilon, max_steps, worst)
        all_steps.append(t)
        all_returns.append(total)
    return top, inner, all_steps, all_returns


def run_option(how, s, step, marks, top, inner, draws, gamma, teacher, epsilon, max_steps, worst):
    t, total = 0, 0.0
    while True:
        choice, began, gain, discount = pick(top[s], next(draws), epsilon), s, 0.0, 1.0
        while True:
            a = marks.move(choice, s) if isinstance(choice, tuple) else choice
            s2, reward = step(s, a, draws)
            over = marks.terminal(s2)
            gain, discount, t, total = gain + discount * reward, discount * gamma, t + 1, total + reward
            if how == "intra-option-q":
                best = 0.0 if over else max(top[s2].values())
                after = dict(top[s2])
                for other in top[s]:
                    if (marks.move(other, s) if isinstance(other, tuple) else other) == a:
                        goes_on = isinstance(other, tuple) and not over and marks.may(other, s2)
                        value = after[other] if goes_on else best
                        teacher.teach(top[s], other, reward + gamma * value)
            s = s2
            if over or t >= max_steps or not (isinstance(choice, tuple) and marks.may(choice, s)):
                break
        if how == "option-q" and (over or t < max_steps):
            target = gain if over else gain + discount * max(top[s].values())
            teacher.teach(top[began], choice, target)
        if over or t >= max_steps:
            return t, total


def run_machine(how, s, step, marks, top, inner, draws, gamma, teacher, epsilon, max_steps, worst):
    t, total, waiting, running = 0, 0.0, None, None

    def settle(table):
        if waiting is not None:
            values, choice, gain, discount = waiting
            teacher.teach(values, choice, gain + discount * max(table.values()))

    while True:
        if running is None:
            settle(top[s])
            choice = pick(top[s], next(draws), epsilon)
            waiting = (top[s], choice, 0.0, 1.0)
            a = choice
            running = choice if isinstance(choice, tuple) else None
        if running is not None:
            table = inner[running, s]
            settle(table)
            a = pick(table, next(draws), epsilon)
            waiting = (table, a, 0.0, 1.0)
        s, reward = step(s, a, draws)
        t, total = t + 1, total + reward
        waiting = (waiting[0], waiting[1], reward, gamma)
        if marks.terminal(s):
            teacher.teach(waiting[0], waiting[1], reward)
        if marks.terminal(s) or t >= max_steps:
            return t, total
        if running is not None and not marks.may(running, s):
            running = None


def run_agents(how, s, step, marks, top, inner, draws, gamma, teacher, epsilon, max_steps, worst):
    t, total, waiting = 0, 0.0, None
    negotiated = how == "w-learning"
    while True:
        if waiting is not None:
            values, choice, reward = waiting
            teacher.teach(values, choice, reward + gamma * max(top[s].values()))
        choice = pick(top[s], next(draws), 0.0 if negotiated else epsilon)
        waiting = None if negotiated else [top[s], choice, 0.0]
        a = choice
        if isinstance(choice, tuple):
            wishes = inner[choice, s]
            a = pick(wishes, next(draws), epsilon)
            if wishes[a] < max(wishes.values()):
                waiting = None
        s2, reward = step(s, a, draws)
        over = marks.terminal(s2)
        t, total = t + 1, total + reward
        if waiting is not None:
            waiting[2] = reward
        for option in marks.open(s):
            own = inner[option, s]
            arrived = marks.mark_of[s2] == option[1]
            goes_on = not over and not arrived and marks.may(option, s2)
            if not negotiated:
                target = 1.0 if arrived else gamma * max(inner[option, s2].values()) if goes_on else 0.0
            else:
                hopes = [max(inner[other, s2].values()) for other in marks.open(s2)]
                value = 0.0 if over else max(hopes, default=worst) if arrived else worst
                target = reward + gamma * (max(inner[option, s2].values()) if goes_on else value)
                if own[a] < max(own.values()):
                    teacher.teach(top[s], option, max(own.values()) - target)
            teacher.teach(own, a, target)
        s = s2
        if over and waiting is not None:
            teacher.teach(waiting[0], waiting[1], reward)
        if over or t >= max_steps:
            return t, total


def polled(marks, top, inner, start):
    """[{move: value}] of each state: the best of the choices at the top that begin with a move.

    top[s]: {choice: value}.  inner(option, s): {move: value} of an option's moves, or None where it goes its way.
    start: None, or from where learners that keep to a choice until it has ended are asked for their way: where a
    choice is under way its move is all there is, and elsewhere moves as good as that of the way count for less.
    """

    def begins(choice, s):
        if not isinstance(choice, tuple):
            return choice
        values = inner(choice, s)
        return marks.move(choice, s) if values is None else max(values, key=values.get)

    table = [{} for _ in top]
    for s, values in enumerate(top):
        for choice, value in values.items():
            move = begins(choice, s)
            table[s][move] = max(value, table[s].get(move, value))
    s, running, passed, worth = start, None, set(), 0.0
    while s is not None and not marks.terminal(s) and s not in passed:
        passed.add(s)
        chosen = running not in top[s]
        running = max(top[s], key=top[s].get) if chosen else running
        move = begins(running, s)
        worth = table[s].get(move, worth)
        if not chosen:
            table[s] = {move: worth}
        for other, value in table[s].items():
            if other != move and value >= worth - 1e-9 * abs(worth):
                table[s][other] = worth - 1e-9 * abs(worth)
        running = running if isinstance(running, tuple) else None
        s = marks.likely[s][move]
    return table


def power(base, n):
    """Base to the n-th by squaring: what compiled loops make of it, which differs in the last bit from C's pow."""
    found = 1.0
    while n:
        if n % 2:
            found *= base
        base, n = base * base, n // 2
    return found


class Maxq:
    """MAXQ-Q by recursion; a task is (name, calls, over, may, pseudo): see the fields below."""

    def __init__(self, tasks, n_states, n_moves, *, gamma, rate, epsilon):
        # tasks: name -> {"calls": [names or moves], "may": f(call, state), "pseudo": f(state)}; "root" is the root
        self.tasks, self.gamma, self.teacher, self.epsilon = tasks, gamma, Teacher(rate), epsilon
        self.move_value = [[0.0] * n_moves for _ in range(n_states)]
        self.own, self.outer = {}, {}

    def open(self, name, s):
        return [call for call in self.tasks[name]["calls"] if self.tasks[name]["may"](call, s)]

    def value(self, call, s):
        """What others see in a call."""
        if isinstance(call, int):
            return self.move_value[s][call]
        best = self.best(call, s)
        return self.value(best, s) + self.outer.get((call, s, best), 0.0)

    def chosen_by(self, name, s):
        return {c: self.value(c, s) + self.own.get((name, s, c), 0.0) for c in self.open(name, s)}

    def best(self, name, s):
        values = self.chosen_by(name, s)
        return max(values, key=values.get)

    def learn(self, step, terminal, starts, episodes, seed, max_steps):
        draws = xoshiro(seed)
        all_steps, all_returns = [], []
        for _ in range(episodes):
            self.t, self.total = 0, 0.0
            self.perform("root", beginning(starts, draws), step, terminal, draws, max_steps)
            all_steps.append(self.t)
            all_returns.append(self.total)
        return all_steps, all_returns

    def perform(self, name, s, step, terminal, draws, max_steps):
        """Run a task to its end; the state it leaves."""
        while True:
            u = next(draws)
            values = dict.fromkeys(self.open(name, s), 0.0) if explored(u, self.epsilon) else self.chosen_by(name, s)
            call, when, s0 = pick(values, u, self.epsilon), self.t, s
            if isinstance(call, int):
                s, reward = step(s, call, draws)
                self.teacher.teach(self.move_value[s0], call, reward)
                self.t, self.total = self.t + 1, self.total + reward
                cut = False
            else:
                s, cut = self.perform(call, s, step, terminal, draws, max_steps)
            if cut:
                return s, True
            over = terminal(s) or not self.open(name, s)
            discount = power(self.gamma, self.t - when)
            own, seen = discount * self.tasks[name]["pseudo"](s), 0.0
            if not over:
                values = self.chosen_by(name, s)
                best = max(values, key=values.get)
                own = discount * values[best]
                seen = discount * (self.value(best, s) + self.outer.get((name, s, best), 0.0))
            alpha = self.teacher.next_rate((name, s0, call))
            for table, target in ((self.own, own), (self.outer, seen)):
                old = table.get((name, s0, call), 0.0)
                table[name, s0, call] = old + alpha * (target - old)
            if over:
                return s, False
            if self.t >= max_steps:
                return s, True


def dense(outcomes, n_states, n_moves):
    """(chance (S, A, S), expected reward (S, A)) of outcomes(s, a) -> [(probability, next state, reward)]."""
    chance, reward = np.zeros((n_states, n_moves, n_states)), np.zeros((n_states, n_moves))
    for s in range(n_states):
        for a in range(n_moves):
            for p, t, r in outcomes(s, a):
                chance[s, a, t] += p
                reward[s, a] += p * r
    return chance, reward
