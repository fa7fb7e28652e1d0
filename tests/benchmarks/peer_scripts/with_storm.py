"""Storm's discounted rewards: optimistic value iteration on its sparse engine, to an absolute error."""

import numpy as np
import stormpy
from peer_data import answer, cpu_seconds
from sparse_world import error, gamma, n_actions, n_states, probability, reward, row_start, save, target

rows = n_states * n_actions
builder = stormpy.datastructures.SparseMatrixBuilder[float](
    rows=rows, columns=n_states, entries=len(target), has_custom_row_grouping=True, row_groups=n_states
)
row = np.repeat(np.arange(rows), np.diff(row_start))
builder.add_next_values(row.tolist(), target.tolist(), probability.tolist(), list(range(0, rows, n_actions)))
labels = stormpy.models.StateLabeling(n_states)
labels.add_label("init")
labels.add_label_to_state("init", 0)
rewards = stormpy.models.SparseRewardModel[float](optional_state_action_reward_vector=reward.tolist())
model = stormpy.models.SparseMdp(
    stormpy.models.SparseModelComponents(
        transition_matrix=builder.build(), state_labeling=labels, reward_models={"reward": rewards}
    )
)
environment = stormpy.Environment()
solver = environment.solver().min_max()
solver.method = stormpy.environments.MinMaxMethod.OPTIMISTIC_VALUE_ITERATION
solver.precision = stormpy.Rational(error)
solver.relative_termination_criterion = False
asked = stormpy.parse_property(f'R{{"reward"}}max=? [ Cdiscount={gamma} ]')
found = []
seconds = cpu_seconds(lambda: found.append(stormpy.model_checking(model, asked, environment=environment)))
save(np.array([found[0].get_value(state) for state in range(n_states)]))
answer(seconds=seconds)
