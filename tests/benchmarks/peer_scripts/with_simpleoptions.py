"""SimpleOptions' agent over given options: Q-learning when one ends, as option-q, and its own intra-option update.

An option makes ``move[option, state]`` until there is none.  Single moves are offered where ``single`` says so.
"""

import random

from peer_data import Maze, answer, cpu_seconds, load
from simpleoptions import BaseEnvironment, BaseOption, OptionAgent, PrimitiveOption

data = load()
NONE = 255


class Way(BaseOption):
    """A given way to a landmark."""

    def __init__(self, number, moves) -> None:
        super().__init__()
        self.number, self.moves = number, moves

    def initiation(self, state):
        return self.moves[state] != NONE

    def policy(self, state, test=False):
        return self.moves[state]

    def termination(self, state):
        return self.moves[state] == NONE

    def __hash__(self):
        return self.number  # asked for several times a step

    def __eq__(self, other):
        return isinstance(other, Way) and other.number == self.number


class World(BaseEnvironment):
    """The maze as SimpleOptions has it."""

    def __init__(self) -> None:
        super().__init__()
        self.maze, self.single = Maze(data), data["single"].tolist()
        self.lengths = []

    def reset(self, state=None):
        self.lengths.append(0)
        return self.maze.reset()

    def step(self, action, state=None):
        self.lengths[-1] += 1
        return *self.maze.move(action), {}

    def render(self, mode="human"):
        pass

    def close(self):
        pass

    def get_state_space(self):
        return set(range(len(self.single)))

    def get_action_space(self):
        return {0, 1, 2, 3}

    def get_available_actions(self, state=None):
        return [0, 1, 2, 3] if self.single[state] else []

    def is_state_terminal(self, state=None):
        return (self.maze.state if state is None else state) == self.maze.goal

    def get_initial_states(self):
        return [self.maze.start]

    def get_successors(self, state=None, actions=None):
        raise NotImplementedError


def learn() -> list[int]:
    """Steps of the episodes."""
    world = World()
    ways = [Way(number, moves) for number, moves in enumerate(data["move"].tolist())]
    world.set_options([*ways, *(PrimitiveOption(action, world) for action in range(4))])
    agent = OptionAgent(
        world, epsilon=data["epsilon"], macro_alpha=data["alpha"], intra_option_alpha=data["alpha"], gamma=data["gamma"]
    )
    runs.append(cpu_seconds(lambda: agent.run_agent(1, data["steps"], verbose_logging=bool(data["logs"]))))
    return world.lengths


runs: list[float] = []
random.seed(0)
lengths = [learn() for _ in range(data["rounds"])]
late = [length for run in lengths for length in run[len(run) // 2 : -1]]
answer(speeds=[data["steps"] / took for took in runs], late_steps=sum(late) / len(late))
