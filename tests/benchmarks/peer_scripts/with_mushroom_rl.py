"""MushroomRL's tabular Q-learner, on a world that looks its moves up (its own ``FiniteMDP`` draws from all states)."""

import numpy as np
from mushroom_rl.algorithms.value import QLearning
from mushroom_rl.core import Core, Environment, MDPInfo
from mushroom_rl.policy import EpsGreedy
from mushroom_rl.utils.parameters import Parameter
from mushroom_rl.utils.spaces import Discrete
from peer_data import Maze, answer, cpu_seconds, load

data = load()


class World(Environment):
    """The maze as MushroomRL has it."""

    def __init__(self) -> None:
        self.maze = Maze(data)
        super().__init__(MDPInfo(Discrete(len(data["successor"])), Discrete(4), data["gamma"], np.inf))

    def reset(self, state=None):
        return np.array([self.maze.reset()])

    def step(self, action):
        state, reward, over = self.maze.move(int(action[0]))
        return np.array([state]), reward, over, {}


def speed() -> float:
    world = World()
    agent = QLearning(world.info, EpsGreedy(Parameter(data["epsilon"])), Parameter(data["alpha"]))
    core = Core(agent, world)
    return data["steps"] / cpu_seconds(lambda: core.learn(n_steps=data["steps"], n_steps_per_fit=1, quiet=True))


np.random.seed(0)
answer(speeds=[speed() for _ in range(data["rounds"])])
