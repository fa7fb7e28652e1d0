"""OpenSpiel's tabular Q-learner."""

import numpy as np
from open_spiel.python import rl_environment, rl_tools
from open_spiel.python.algorithms import tabular_qlearner
from peer_data import Maze, answer, cpu_seconds, load

data = load()
maze = Maze(data)
LEGAL = [[0, 1, 2, 3]]


def time_step(state, reward, kind):
    observations = {"info_state": [state], "legal_actions": LEGAL, "current_player": 0}
    return rl_environment.TimeStep(observations, reward, None, kind)


def learn() -> None:
    agent = tabular_qlearner.QLearner(
        0, 4, data["alpha"], rl_tools.ConstantSchedule(data["epsilon"]), discount_factor=data["gamma"]
    )
    made = 0
    while made < data["steps"]:
        now = time_step(maze.reset(), None, rl_environment.StepType.FIRST)
        while not now.last() and made < data["steps"]:
            state, reward, over = maze.move(agent.step(now).action)
            kind = rl_environment.StepType.LAST if over else rl_environment.StepType.MID
            now = time_step(state, [reward], kind)
            made += 1
        agent.step(now)


np.random.seed(0)
answer(speeds=[data["steps"] / cpu_seconds(learn) for _ in range(data["rounds"])])
