from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ttest_rel

from rf_pointing.calibration import AcceptanceRules, AcceptanceScore, BiasModel

RULES = AcceptanceRules()


def score_of(data, active, candidate):
    score = AcceptanceScore(active, candidate, RULES)
    score.add(data)
    return score


def test_the_true_model_is_found_better_and_its_rms_is_the_noise(campaign, table_1):
    data = campaign(table_1, passes=8, form="rotation")
    verdict = score_of(data, BiasModel.zero(), table_1).verdict()
    assert verdict.word == "better"
    assert verdict.passes == 8
    # Azimuth noise of 1e-4 rad shrinks by cos El on the sky.
    assert 1.0e-4 < verdict.candidate_rms_rad < 1.45e-4
    assert verdict.active_rms_rad > 1e-3


def test_the_wrong_model_is_found_worse(campaign, table_1):
    data = campaign(table_1, passes=8, form="rotation")
    assert score_of(data, table_1, BiasModel.zero()).verdict().word == "worse"


def test_equal_models_and_few_passes_stay_undecided(campaign, table_1):
    data = campaign(table_1, passes=6, form="rotation")
    assert score_of(data, table_1, table_1).verdict().word == "undecided"
    two = data.select(data.pass_id < 2)
    assert score_of(two, BiasModel.zero(), table_1).verdict().word == "undecided"


def test_a_gain_that_is_the_same_in_every_pass_is_certain(campaign, table_1):
    one = campaign(table_1, passes=1, sigma_rad=0.0, form="rotation")
    score = score_of(one, BiasModel.zero(), table_1)
    for number in (1, 2):
        score.add(replace(one, pass_id=np.full(len(one), number)))
    verdict = score.verdict()
    assert (verdict.word, verdict.passes) == ("better", 3)
    assert verdict.t_value > 1e6


def test_a_pass_in_pieces_scores_as_the_pass_at_once_and_a_copy_continues_identically(campaign, table_1):
    data = campaign(table_1, passes=4, form="rotation")
    whole = score_of(data, BiasModel.zero(), table_1)
    pieces = AcceptanceScore(BiasModel.zero(), table_1, RULES)
    first, second = np.array_split(np.arange(len(data)), 2)
    pieces.add(data.select(first))
    copy = deepcopy(pieces)
    pieces.add(data.select(second))
    copy.add(data.select(second))
    assert copy.verdict() == pieces.verdict()
    assert pieces.verdict().t_value == pytest.approx(whole.verdict().t_value, rel=1e-9)


def test_nothing_to_judge_is_an_error(table_1):
    with pytest.raises(ValueError, match="observations=0"):
        AcceptanceScore(table_1, table_1, RULES).verdict()


@pytest.mark.parametrize("passes", [2, 3, 7])
def test_the_t_value_is_that_of_paired_samples_over_passes(campaign, table_1, passes):
    data = campaign(table_1, passes=passes, sigma_rad=3e-4, form="rotation")
    near = table_1.replace(elevation_offset=table_1.coefficients["elevation_offset"] + 2e-4)
    score = AcceptanceScore(near, table_1, AcceptanceRules(fewest_passes=2))
    score.add(data)
    rms, squares = {}, {}
    for name, model in (("active", near), ("candidate", table_1)):
        azimuth, elevation = model.apply(*data.motion())
        across = (data.observed_azimuth_rad - azimuth) * np.cos(data.true_elevation_rad)
        squares[name] = across**2 + (data.observed_elevation_rad - elevation) ** 2
        rms[name] = [np.sqrt(np.mean(squares[name][data.pass_id == number])) for number in range(passes)]
    expected = ttest_rel(rms["active"], rms["candidate"]).statistic
    verdict = score.verdict()
    assert verdict.t_value == pytest.approx(expected, rel=1e-9)
    assert verdict.word == ("better" if expected >= 2.0 else "undecided")
    assert verdict.active_rms_rad == pytest.approx(np.sqrt(np.mean(squares["active"])), rel=1e-9)
    assert verdict.candidate_rms_rad == pytest.approx(np.sqrt(np.mean(squares["candidate"])), rel=1e-9)
