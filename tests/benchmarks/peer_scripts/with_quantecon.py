"""QuantEcon's modified policy iteration on sparse state-action pairs."""

import numpy as np
from peer_data import answer, cpu_seconds
from quantecon.markov import DiscreteDP
from scipy.sparse import csr_matrix
from sparse_world import error, gamma, n_actions, n_states, probability, reward, row_start, save, target

tiny = DiscreteDP(np.zeros(2), csr_matrix(np.eye(2)), gamma, np.arange(2), np.zeros(2, int))
tiny.solve("mpi")  # compile
pairs = csr_matrix((probability, target, row_start), (n_states * n_actions, n_states))
states, actions = np.repeat(np.arange(n_states), n_actions), np.tile(np.arange(n_actions), n_states)
problem = DiscreteDP(reward, pairs, gamma, states, actions)
found = []
seconds = cpu_seconds(lambda: found.append(problem.solve("mpi", epsilon=error)))
save(found[0].v)
answer(seconds=seconds)
