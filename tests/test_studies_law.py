"""The law's corridors, and its fits: a true law is found, a false one refused."""

import numpy as np

from qualrl.studies.claims import Coefficient
from qualrl.studies.law.score import corridor_fits, corridor_model, corridors
from qualrl.studies.settings import load_study
from qualrl.studies.study import judge


def test_corridors_have_a_landmark_at_every_step_of_their_spacing():
    model = corridor_model((12, 4), 0.9)
    assert model.landmarks.names == ("S0", "S1", "S2", "goal")
    assert np.flatnonzero(model.landmarks.landmark_of >= 0).tolist() == [0, 4, 8, 12]
    assert int(model.grid.steps_to_goal[model.starts[0]]) == 12
    law = load_study("law").law
    assert law is not None
    assert all(n % m == 0 and n >= 2 * m for n, m in corridors(law))


def test_a_law_that_is_true_is_found_and_one_that_is_not_is_refused():
    law = load_study("law")
    assert law.law is not None
    pairs = corridors(law.law)
    flat = {(n, n): 0.7 * n - 4 for n in law.law.lengths}
    wobble = {pair: 0.2 * np.cos(9 * sum(pair)) for pair in pairs}
    pure = {(n, m): 0.8 * m - 3 + wobble[n, m] for n, m in pairs}
    mixed = {(n, m): 0.2 * m + 0.5 * n + 0.01 * max(n - 6 * m, 0) + wobble[n, m] for n, m in pairs}
    verdicts = {}
    for name, costs in (("pure", pure), ("mixed", mixed)):
        fits = corridor_fits({"QL": flat, "HQL": costs}, law.law.most_stretches)
        asked = [each for each in law.claims if isinstance(each, Coefficient) and "corridors" in each.fit]
        verdicts[name] = [judge(each, {}, fits, {}).verdict for each in asked]
    assert verdicts["pure"] == ["reproduced", "reproduced", "reproduced", "not reproduced"]
    assert verdicts["mixed"] == ["reproduced", "not reproduced", "not reproduced", "not reproduced"]
