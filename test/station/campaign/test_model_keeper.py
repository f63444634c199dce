"""Nothing but accept and roll back changes the model in force; a candidate runs in the shadow until then."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import AcceptanceRules, BiasModel, ModelVersion, Observations
from rf_pointing.core import MDEG
from rf_pointing.station.campaign.model_keeper import ModelKeeper

NOW_S = 1.7e9


def model_file(name: str, offset_rad: float = 0.0) -> ModelVersion:
    return ModelVersion(
        name=name, station="gs1", band="X", software="test", created_t_s=NOW_S, valid_from_t_s=NOW_S, valid_until_t_s=None,
        first_t_s=NOW_S, last_t_s=NOW_S, observations=50, rejected=0, passes=3, form="rotation", condition=10.0,
        rms_cross_elevation_rad=1e-5, rms_elevation_rad=1e-5, mean_azimuth_rad=0.0, mean_elevation_rad=0.0,
        model=BiasModel.zero().replace(azimuth_offset=offset_rad), fitted=("azimuth_offset",), covariance=np.eye(1) * 1e-10,
    )  # fmt: skip


def seen(pass_id: int, azimuth_offset_rad: float) -> Observations:
    """Return a pass of an antenna with this azimuth offset, which differs a little from pass to pass."""
    azimuth, zero = np.linspace(0.5, 1.5, 20), np.zeros(20)
    return Observations(
        station="gs1", band="X", t_s=NOW_S + 1000.0 * pass_id + np.arange(20.0), pass_id=np.full(20, pass_id),
        observed_azimuth_rad=azimuth + azimuth_offset_rad * (1.0 + 0.1 * pass_id), observed_elevation_rad=zero + 0.7,
        true_azimuth_rad=azimuth, true_elevation_rad=zero + 0.7, azimuth_rate_rad_s=zero, elevation_rate_rad_s=zero,
        azimuth_acceleration_rad_s2=zero, elevation_acceleration_rad_s2=zero,
        sigma_azimuth_rad=zero + 1e-5, sigma_elevation_rad=zero + 1e-5,
    )  # fmt: skip


def keeper(folder: str = "", start: ModelVersion | None = None, accept: str = "not worse") -> ModelKeeper:
    made = ModelKeeper("gs1", "X", folder, start, AcceptanceRules(accept=accept))
    made.begin(NOW_S)
    return made


def test_a_candidate_is_in_force_only_when_accepted_and_rolled_back_to_the_start_model(tmp_path):
    kept = keeper(str(tmp_path), model_file("old", 1.0 * MDEG))
    kept.propose(model_file("new", 2.0 * MDEG))
    assert kept.active.name == "old"
    assert kept.accept(NOW_S).name == "new"
    assert keeper(str(tmp_path)).active.name == "new"
    assert kept.roll_back().name == "old"
    assert keeper(str(tmp_path)).active.name == "old"


def test_without_a_folder_the_way_back_lasts_as_long_as_the_node():
    kept = keeper()
    with pytest.raises(ValueError, match="nothing to roll back to"):
        kept.roll_back()
    kept.propose(model_file("new"))
    kept.accept(NOW_S)
    assert kept.roll_back() is None


def test_a_candidate_that_does_worse_in_the_shadow_is_not_accepted():
    kept = keeper(start=model_file("good", 20.0 * MDEG))
    kept.propose(model_file("bad"))
    for number in range(4):
        kept.observe(seen(number, 20.0 * MDEG))
    assert kept.verdict().word == "worse"
    with pytest.raises(ValueError, match="candidate 'bad' is worse after 4 passes in shadow"):
        kept.accept(NOW_S)
    assert kept.reject() == "bad"
    assert kept.active.name == "good"


def test_by_default_a_candidate_must_have_been_better_in_the_shadow_to_be_accepted():
    kept = ModelKeeper("gs1", "X", "", None, AcceptanceRules())
    kept.begin(NOW_S)
    kept.propose(model_file("new", 20.0 * MDEG))
    with pytest.raises(ValueError, match="not yet observed in shadow; it must be better after fewest_passes=3"):
        kept.accept(NOW_S)
    for number in range(2):
        kept.observe(seen(number, 20.0 * MDEG))
    with pytest.raises(ValueError, match="undecided after 2 passes in shadow: rms 1.08 mdeg, active 16.08 mdeg"):
        kept.accept(NOW_S)
    kept.observe(seen(2, 20.0 * MDEG))
    assert kept.verdict_text().startswith("better after 3 passes")
    assert kept.accept(NOW_S).name == "new"


def test_each_band_has_models_of_its_own(tmp_path):
    kept = keeper(str(tmp_path))
    kept.propose(model_file("new"))
    kept.accept(NOW_S)
    other = ModelKeeper("gs1", "Ka", str(tmp_path), None, AcceptanceRules(accept="not worse"))
    other.begin(NOW_S)
    assert other.active is None
    with pytest.raises(ValueError, match="is of band 'X', must be of 'Ka'"):
        other.propose(model_file("x"))


def test_a_start_model_of_another_station_and_an_expired_accepted_one_are_not_used(tmp_path):
    with pytest.raises(ValueError, match="is of station 'gs2', must be of 'gs1'"):
        keeper(start=replace(model_file("foreign"), station="gs2"))
    kept = keeper(str(tmp_path))
    kept.propose(replace(model_file("short"), valid_until_t_s=NOW_S + 10.0))
    kept.accept(NOW_S)
    later = ModelKeeper("gs1", "X", str(tmp_path), None, AcceptanceRules())
    later.begin(NOW_S + 20.0)
    assert later.active is None


def test_a_model_with_thermal_terms_needs_a_temperature(tmp_path):
    kept = keeper(str(tmp_path))
    thermal = replace(model_file("thermal"), model=BiasModel.zero().replace(azimuth_temperature=1e-5))
    with pytest.raises(ValueError, match="azimuth_temperature, and no temperature has been received"):
        kept.propose(thermal)
    assert kept.candidate is None
    kept.temperature_k = 298.15
    kept.propose(thermal)
    assert kept.accept(NOW_S).name == "thermal"
    assert kept.model.coefficients["azimuth_offset"] == pytest.approx(1e-4)
    kept.temperature_k = None
    with pytest.raises(ValueError, match="no temperature has been received"):
        _ = kept.model
