"""rlberry's tabular Q-learner, without its log."""

import gymnasium
from peer_data import Maze, answer, cpu_seconds, load
from rlberry_scool.agents.tabular_rl.qlearning import QLAgent

data = load()


class World(gymnasium.Env):
    """The maze as Gymnasium has it."""

    def __init__(self) -> None:
        self.maze = Maze(data)
        self.observation_space = gymnasium.spaces.Discrete(len(data["successor"]))
        self.action_space = gymnasium.spaces.Discrete(4)

    def reset(self, seed=None, options=None):
        return self.maze.reset(), {}

    def step(self, action):
        return *self.maze.move(action), False, {}


def speed(seed: int) -> float:
    agent = QLAgent(World(), data["gamma"], data["alpha"], "epsilon", data["epsilon"], seeder=seed)
    agent.set_writer(None)
    return data["steps"] / cpu_seconds(lambda: agent.fit(data["steps"]))


answer(speeds=[speed(seed) for seed in range(data["rounds"])])
