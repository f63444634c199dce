"""What follows from a description, against numbers worked out by hand from the formulas that it states."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from rf_pointing.rf.dish_array import DishArrayParams, least_level_db_hz
from rf_pointing.station.derive.nodes import owner_of_name
from rf_pointing.station.description import station_from
from rf_pointing.station.description.description import StationDescription, require_known

STEP_DEG = 360.0 / 2**20
"""Of an encoder that is not described."""


def described(**changes: Any) -> StationDescription:
    """Return a 3-m X-band dish of 6 and 3 deg/s with other sections; AZIMUTH and the like are of an axis or the band."""
    azimuth = {"travel_deg": [-270, 270], "rate_deg_s": 6} | changes.pop("AZIMUTH", {})
    elevation = {"travel_deg": [0, 90], "rate_deg_s": 3} | changes.pop("ELEVATION", {})
    mount = {"azimuth": azimuth, "elevation": elevation} | changes.pop("MOUNT", {})
    band = {"frequency_mhz": 8400} | changes.pop("BAND", {})
    site = {"latitude_deg": 48.1, "longitude_deg": 11.6, "height_m": 520}
    content = {
        "version": 1, "name": "Mine", "site": site, "dish": {"diameter_m": 3.0}, "mount": mount,
        "bands": {"X": band},
    }  # fmt: skip
    content |= changes
    return station_from(
        Path("s.yaml"), yaml.safe_dump({key: value for key, value in content.items() if value is not None})
    )


COARSE = {"AZIMUTH": {"resolution_deg": 0.4}, "ELEVATION": {"encoder_bits": 12}}
WIDE = {"dish": None, "BAND": {"half_power_beamwidth_deg": 60.0, "frequency_mhz": 145.9}}
CASES: Mapping[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "nothing but what must be said": ({}, {
        # The mount.
        "limits.azimuth_min_deg": -270.0, "limits.azimuth_max_deg": 270.0,
        "limits.elevation_min_deg": 0.0, "limits.elevation_max_deg": 90.0,
        "machine.rate_limit_deg_s": (5.4, 2.7), "machine.acceleration_limit_deg_s2": (2.4, 1.2),
        "loops.preprocessor.rate_limit_deg_s": (5.4, 2.7), "loops.preprocessor.acceleration_limit_deg_s2": (2.4, 1.2),
        "loops.preprocessor.travel_min_deg": (-270.1, -0.1), "loops.preprocessor.travel_max_deg": (270.1, 90.1),
        "safety.park_azimuth_deg": 0.0, "safety.park_elevation_deg": 45.0, "safety.stow_elevation_deg": 90.0,
        "publisher.mask_deg": 5.0, "pointing.stop_deceleration_deg_s2": 0.75,
        # The drive.
        "drive.rotator.rate_deg_s": (6.0, 3.0), "drive.rotator.resolution_deg": (0.0, 0.0),
        "drive.rotator.travel_min_deg": (-275.0, -2.0), "drive.rotator.travel_max_deg": (275.0, 92.0),
        # Zones.
        "machine.sun_radius_deg": 1.0, "gate.sun_radius_deg": 1.0, "safety.gate.sun_radius_deg": 1.0,
        "sun.watched": True, "safety.sun.watched": True, "gate.transmit_elevation_deg": 10.0,
        "safety.wind.watched": False, "safety.wind.stows": True,
        "safety.wind.gust_limit_m_s": 25.0, "safety.wind.mean_limit_m_s": 18.0,
        # h = 66 deg * 35.68958 mm / 3 m.
        "signal.beam.half_power_beamwidth_deg": 0.785171, "pointing.on_target_deg": 0.0785171,
        "calibrator.largest_error_deg": 0.079,
        "conscan.radius_deg": 0.0716, "conscan.period_s": 4.0, "conscan.ramp_s": 2.0, "conscan.window_samples": 80,
        "conscan.fewest_samples": 40, "conscan.unmodelled_deg": 0.001, "conscan.bandwidth_hz": 0.1,
        "conscan.sample_s": 0.1, "conscan.delay_s": 0.0, "conscan.drift": True, "conscan.misfit_limit": 20.0,
        "steptrack.step_beamwidths": 0.08, "steptrack.dwell_s": 0.7, "steptrack.samples_per_point": 5,
        "steptrack.tolerance": 0.5,
        # A quintic over sqrt(2) steps of 0.0628137 deg at 1.2 deg/s2.
        "steptrack.move_s": 0.653753,
        "spiral.uncertainty_deg": 0.065, "spiral.rate_deg_s": 0.45, "spiral.acceleration_deg_s2": 0.525,
        "integrator.offset_limit_deg": 1.1777565, "integrator.acceleration_deg_s2": 0.3, "integrator.mean_of": 5,
        "integrator.bandwidth_hz": 0.2, "integrator.sample_s": 0.1, "trim.bias_walk_deg": 0.002, "trim.bias_deg": 0.1,
        "watch.gust_deg": (1e-4, 2e-4, 4e-4, 8e-4), "watch.vibration_deg": (0.0, 2e-4, 6e-4),
        "link.reference_range_m": 780e3, "link.zenith_carrier_to_noise_db_hz": 60.0,
        "signal.link.reference_range_m": 780e3, "pointing.lag_averaging_s": 5.0, "antenna.lag_averaging_s": 5.0,
        # The sky: 2.725 K behind 0.04 dB of 275 K.
        "signal.atmosphere.zenith_loss_db": 0.04, "signal.noise.lna_k": 120.0 - 8.0 - 2.7000 - 2.5211,
        "signal.noise.dichroic_k": 0.0, "signal.cluster_samples": 5, "signal.receiver.system_noise_k": 120.0,
        "antenna.start_azimuth_deg": 0.0, "antenna.start_elevation_deg": 45.0, "wind.dish_diameter_m": 3.0,
        "wind.mean_speed_m_s": 0.0,
        "plant.azimuth.rate_limit_deg_s": 6.0, "plant.elevation.rate_limit_deg_s": 3.0,
        "plant.azimuth.acceleration_limit_deg_s2": 6.0, "plant.elevation.acceleration_limit_deg_s2": 3.0,
        "plant.azimuth.encoder_bits": 20, "plant.azimuth.travel_min_deg": -275.0, "plant.elevation.travel_max_deg": 92.0,
        "plant.azimuth.travel_max_deg": 275.0, "plant.elevation.travel_min_deg": -2.0, "plant.elevation.backlash_deg": 0.01,
        "loops.azimuth.rate_limit_deg_s": 6.0, "loops.elevation.rate_limit_deg_s": 3.0,
        "loops.lqg_azimuth.rate_limit_deg_s": 6.0, "loops.lqg_elevation.rate_limit_deg_s": 3.0,
        # The watches: of the faster drive, of steps and of a play of 0.01 deg.
        "safety.drive.bandwidth_hz": 3.978874, "safety.drive.acceleration_limit_deg_s2": 6.0,
        "safety.drive.rate_limit_deg_s": 6.0, "safety.drive.disturbance_deg_s2": 4.5, "safety.drive.slack_deg_s2": 0.9,
        "safety.drive.gained_deg_s": 0.06, "safety.drive.excess_deg_s": 1.5, "safety.watch.jump_deg": 0.03,
        "safety.watch.drift_deg": 4.0 * STEP_DEG + 0.04, "safety.watch.frozen_deg": 4.0 * STEP_DEG + 0.02,
        "safety.gate.hard_deg": 0.25, "gate.hard_deg": 0.25, "axes.frozen_deg": 0.02, "axes.reaction_s": 0.3,
        "axes.runaway_deg": 0.5, "loops.oscillation.threshold_deg": 0.0429646,
        "loops.oscillation.gross_threshold_deg": 0.1074114, "loops.oscillation.largest_deg": 0.5,
        "calibrator.station": "Mine", "calibrator.band": "X", "calibrator.model_file": "",
    }),
    "coarse encoders": (COARSE, {
        "pointing.on_target_deg": 1.0, "conscan.unmodelled_deg": 0.1154701, "spiral.uncertainty_deg": 1.2,
        "watch.gust_deg": (1e-4, 2e-4, 4e-4, 8e-4), "watch.vibration_deg": (0.0, 0.1154701, 0.3464102),
        "safety.watch.jump_deg": 2.4, "safety.watch.drift_deg": 1.64, "safety.watch.frozen_deg": 1.62,
        "safety.gate.hard_deg": 1.2, "gate.hard_deg": 1.2, "axes.frozen_deg": 1.6, "axes.runaway_deg": 2.0,
        "loops.oscillation.threshold_deg": 1.6, "loops.oscillation.gross_threshold_deg": 4.0,
        "loops.oscillation.largest_deg": 16.0, "drive.rotator.resolution_deg": (0.4, 0.0),
        # 360 deg / 2**10 = 0.35 deg is nearer to it than 0.70 deg.
        "plant.azimuth.encoder_bits": 10, "plant.elevation.encoder_bits": 12,
    }),
    "no dish and a wide beam": (WIDE, {
        "integrator.offset_limit_deg": 20.0, "axes.runaway_deg": 15.0, "pointing.on_target_deg": 5.0,
        "loops.oscillation.threshold_deg": 3.2832, "loops.oscillation.gross_threshold_deg": 8.208,
        "loops.oscillation.largest_deg": 32.832, "calibrator.largest_error_deg": 5.0, "wind.dish_diameter_m": 1.0,
        "spiral.rate_deg_s": 0.45, "signal.beam.half_power_beamwidth_deg": 60.0, "machine.half_power_beamwidth_deg": 60.0,
        # 0.03 dB at 100 MHz, 0.035 dB at 2300 MHz, a straight line over the logarithm.
        "signal.atmosphere.zenith_loss_db": 0.0306, "signal.receiver.system_noise_k": 400.0,
        "signal.noise.lna_k": 400.0 - 8.0 - 2.70587 - 1.93082,
    }),
    "a scan at the limit of the acceleration": ({"dish": {"diameter_m": 0.5}}, {
        # h = 4.71102 deg, r = 0.43 deg: 2 pi sqrt(0.43 / 0.36) = 6.867 s.
        "conscan.radius_deg": 0.43, "conscan.period_s": 6.9, "conscan.ramp_s": 3.45, "conscan.window_samples": 138,
        "conscan.fewest_samples": 69, "conscan.bandwidth_hz": 0.4 / 6.9, "steptrack.move_s": 1.601360,
    }),
    "a scan at the limit of the rate": (
        {"dish": {"diameter_m": 0.5}, "ELEVATION": {"rate_deg_s": 0.5, "acceleration_deg_s2": 5.0}}, {
        # 2 pi * 0.43 deg / (0.25 * 0.45 deg/s) = 24.02 s; 1.875 * 0.532992 deg / (0.5 * 0.45 deg/s).
        "conscan.period_s": 24.1, "conscan.window_samples": 482, "steptrack.move_s": 4.441601,
        "spiral.rate_deg_s": 0.075, "machine.acceleration_limit_deg_s2": (2.4, 2.0), "spiral.acceleration_deg_s2": 0.875,
        "safety.drive.rate_limit_deg_s": 6.0, "safety.drive.acceleration_limit_deg_s2": 6.0,
    }),
    "a slow receiver": ({"receiver": {"power_period_s": 0.5, "delay_s": 0.3}}, {
        "conscan.period_s": 6.0, "conscan.window_samples": 24, "conscan.fewest_samples": 12, "conscan.sample_s": 0.5,
        "conscan.delay_s": 0.3, "steptrack.dwell_s": 3.5, "signal.cluster_samples": 25, "integrator.sample_s": 0.5,
    }),
    "a mount that goes over the top": ({"ELEVATION": {"travel_deg": [0, 180]}}, {
        "safety.stow_elevation_deg": 90.0, "drive.rotator.travel_max_deg": (275.0, 182.0),
    }),
    "a very large dish": ({"dish": {"diameter_m": 68.0}, "AZIMUTH": {"rate_deg_s": 0.5}, "ELEVATION": {"rate_deg_s": 0.5}}, {
        "watch.gust_deg": tuple(5.656854 * each for each in (1e-4, 2e-4, 4e-4, 8e-4)),
        "watch.vibration_deg": (0.0, 11.313708e-4, 33.941125e-4),
        "safety.drive.bandwidth_hz": 1.591549, "wind.dish_diameter_m": 68.0,
    }),
    "play in the gears": ({"ELEVATION": {"backlash_deg": 0.1}, "AZIMUTH": {"backlash_deg": 0.05}}, {
        "safety.watch.drift_deg": 4.0 * STEP_DEG + 0.4, "safety.watch.frozen_deg": 4.0 * STEP_DEG + 0.2,
        "plant.azimuth.backlash_deg": 0.05, "plant.elevation.backlash_deg": 0.1,
    }),
    "limits of the commands": (
        {"AZIMUTH": {"command_rate_deg_s": 2.0, "command_acceleration_deg_s2": 1.0, "acceleration_deg_s2": 9.0},
         "ELEVATION": {"acceleration_deg_s2": 1.0}}, {
        "machine.rate_limit_deg_s": (2.0, 2.7), "machine.acceleration_limit_deg_s2": (1.0, 0.4),
        "safety.drive.acceleration_limit_deg_s2": 9.0, "pointing.stop_deceleration_deg_s2": 0.25,
        "plant.azimuth.acceleration_limit_deg_s2": 9.0, "plant.elevation.acceleration_limit_deg_s2": 1.0,
    }),
    "stops that are near on one side": (
        {"AZIMUTH": {"hard_stop_deg": [-270.08, 271.0]}, "ELEVATION": {"hard_stop_deg": [-5.0, 90.05]}}, {
        "loops.preprocessor.travel_min_deg": (-270.04, -0.1), "loops.preprocessor.travel_max_deg": (270.1, 90.025),
        "drive.rotator.travel_min_deg": (-270.08, -5.0), "drive.rotator.travel_max_deg": (271.0, 90.05),
        "plant.azimuth.travel_min_deg": -270.08, "plant.elevation.travel_max_deg": 90.05,
    }),
    "a travel above 0 and 45 deg": ({"AZIMUTH": {"travel_deg": [30, 200]}, "ELEVATION": {"travel_deg": [50, 80]}}, {
        "safety.park_azimuth_deg": 30.0, "safety.park_elevation_deg": 50.0, "safety.stow_elevation_deg": 80.0,
        "antenna.start_azimuth_deg": 30.0, "antenna.start_elevation_deg": 50.0, "publisher.mask_deg": 51.0,
    }),
    "places that are given": (
        {"MOUNT": {"park_deg": [10, 20], "stow_elevation_deg": 0, "pass_elevation_deg": 2, "transmit_elevation_deg": 7},
         "simulation": {"start_deg": [70, 30], "along_track_offset_s": 0.2,
                        "wind": {"mean_speed_m_s": 6, "from_azimuth_deg": 9},
                        "mount_errors": {"droop_deg": 0.3, "collimation_deg": 0.2}, "lag_averaging_s": 2.0},
         "BAND": {"mount_errors": {"droop_deg": 0.1}, "model_error_deg": 0.5}, "sun": {"radius_deg": 0},
         "wind": {"anemometer": True, "stow": False, "gust_limit_m_s": 20, "mean_limit_m_s": 15}}, {
        "safety.park_azimuth_deg": 10.0, "safety.park_elevation_deg": 20.0, "safety.stow_elevation_deg": 0.0,
        "publisher.mask_deg": 2.0, "gate.transmit_elevation_deg": 7.0, "safety.gate.transmit_elevation_deg": 7.0,
        "antenna.start_azimuth_deg": 70.0, "antenna.start_elevation_deg": 30.0, "wind.mean_speed_m_s": 6.0,
        "wind.from_azimuth_deg": 9.0, "mount.droop_deg": 0.1, "mount.collimation_deg": 0.2,
        "source.along_track_offset_s": 0.2, "trim.bias_deg": 0.5, "trim.bias_walk_deg": 0.01,
        "sun.watched": False, "safety.sun.watched": False, "gate.sun_radius_deg": 0.0, "safety.wind.watched": True,
        "safety.wind.stows": False, "safety.wind.gust_limit_m_s": 20.0, "safety.wind.mean_limit_m_s": 15.0,
        "pointing.lag_averaging_s": 2.0, "antenna.lag_averaging_s": 2.0,
    }),
    "a drive that takes positions": (
        {"drive": {"type": "gs232", "rotator": {"minimum_interval_s": 0.7, "latency_s": 0.4},
                   "link": {"poll_period_s": 0.25}}}, {
        # 0.058 over 0.2 s, the latency and half of the interval.
        "integrator.bandwidth_hz": 0.0610526,
        "machine.rate_limit_deg_s": (6.0, 3.0), "axes.reaction_s": 1.6, "drive.type": "gs232",
        "drive.rotator.minimum_interval_s": 0.7,
    }),
    "a drive that rests far from its set points": (
        {"drive": {"type": "gs232", "rotator": {"dead_band_deg": [1.0, 3.0], "minimum_move_deg": [2.0, 0.5]}}}, {
        "pointing.on_target_deg": 3.3,
    }),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_description_gives_the_numbers_that_its_formulas_state(case: str) -> None:
    changes, expected = CASES[case]
    values = described(**changes).values()
    found = {name: values[name].value for name in expected}
    assert found == {
        # Of what is rounded to six digits, and of sums that cancel.
        name: pytest.approx(value, rel=2e-6, abs=1e-4 if name == "signal.noise.lna_k" else 1e-9)
        if not isinstance(value, bool | str) else value
        for name, value in expected.items()
    }  # fmt: skip


def test_an_array_sees_what_its_patches_gain_against_the_dish() -> None:
    """27000 deg^2 / h^2 is 46.4 dBi at 0.785 deg; 8 patches of 5 dBi give 14.0 dBi."""
    section = {"elements": 8, "radius_m": 0.1, "element_gain_dbi": 5.0, "roll_deg": 10.0, "axis_cross_elevation_deg": 1.0,
        "axis_elevation_deg": -2.0, "phase_sigma_deg": 3.0}  # fmt: skip
    values = {name: value.value for name, value in described(array=section).values().items()}
    assert {name: values[f"array.{name}"] for name in section if name != "element_gain_dbi"} == {
        name: value for name, value in section.items() if name != "element_gain_dbi"
    }
    assert values["array.wavelength_m"] == pytest.approx(0.0356896, rel=1e-6)
    # 44.3 dBi + 2.1006 dB - 5 dBi, of four digits; 9.0309 dB less that.
    assert values["array.element_loss_db"] == 41.4
    assert values["autotrack.array_gain_db"] == -32.37
    least = least_level_db_hz(
        DishArrayParams(elements=8, radius_m=0.1, wavelength_m=0.0356896, phase_sigma_rad=math.radians(3.0))
    )
    assert values["autotrack.array_off_db_hz"] == float(f"{least:.3g}")
    assert values["autotrack.array_on_db_hz"] == float(f"{least + 2.0:.3g}")


@pytest.mark.parametrize(
    ("node", "names", "said"),
    [
        ("antenna_servo", ["wrap_file", "antenna.seed", "lifecycle.autostart", "qos_overrides./x"], ""),
        ("bias_calibrator", ["calibrator.band", "calibrator.folder"], ""),
        ("ephemeris_publisher", ["publisher.mask_deg", "mask.clearance_deg"], ""),
        ("**", ["start_s", "calibrator.band", "use_sim_time"], ""),
        ("antena_servo", [], "antena_servo is not a node of a station; did you mean antenna_servo?"),
        ("conscan_tracker", ["calibrator.folder"], "conscan_tracker: no such parameter calibrator.folder"),
        ("**", ["page.prot"], "no such parameter page.prot; did you mean page.port?"),
    ],
)
def test_what_a_parameter_file_may_name(node: str, names: list[str], said: str) -> None:
    if not said:
        require_known(node, names)
        return
    with pytest.raises(ValueError, match=said.replace("*", r"\*").replace("?", r"\?")):
        require_known(node, names)


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("wind.mean_speed_m_s", ""), ("mount.droop_deg", ""), ("antenna.seed", ""),
        ("pointing.lag_averaging_s", "simulation.lag_averaging_s"),
        ("source.site.latitude_deg", "site.latitude_deg"), ("signal.dropouts.count", ""),
        ("wind.dish_diameter_m", "dish.diameter_m"),
        ("autotrack.carrier_on_db_hz", "tuning.autotrack.carrier_on_db_hz"),
        ("conscan.misfit_limit", "tuning.conscan.misfit_limit"), ("array.elements", "array.elements"),
        ("no.such", ""),
    ],
)  # fmt: skip
def test_a_trial_changes_what_only_the_simulation_knows(name: str, key: str) -> None:
    assert owner_of_name(name) == key


CHAIN = [{"loss_db": 0.3}, {"noise_figure_db": 0.5, "gain_db": 30.0}, {"loss_db": 6.0}, {"noise_k": 900.0}]
"""Feed, amplifier, cable, receiver."""


def test_a_stated_chain_and_eirp_give_the_receiver_and_the_controller_the_same_level() -> None:
    """Feed 20.7 K, amplifier 35.39 K / 0.9333, cable 864.5 K and receiver 900 K 3.981 behind 1000 / 1.0715."""
    band = {
        "noise": {"chain": CHAIN, "dichroic_loss_db": 0.02},
        "satellite_eirp_dbw": -3.0,
        "reference_range_km": 500.0,
    }
    station = described(BAND=band)
    values = station.parameters("rf_receiver")
    chain_k = 20.744 + 35.387 * 1.07152 + (864.51 + 900.0 * 3.98107) * 1.07152e-3
    assert values["signal.noise.lna_k"] == pytest.approx(chain_k, abs=0.01)
    assert values["signal.noise.dichroic_k"] == pytest.approx(1.3324, abs=1e-4)
    assert values["signal.noise.ground_k"] == 8.0
    passed = 10.0 ** (-0.1 * values["signal.atmosphere.zenith_loss_db"])
    system_k = chain_k + 1.3324 + 8.0 + values["signal.noise.cosmic_k"] * passed + 275.0 * (1.0 - passed)
    assert values["signal.receiver.system_noise_k"] == pytest.approx(system_k, abs=0.01)
    wavelength = 299792458.0 / 8.4e9
    gain = 26000.0 / (66.0 * wavelength / 3.0) ** 2
    spreading = (4.0 * math.pi * 5e5 / wavelength) ** 2
    level = -3.0 + 10.0 * math.log10(gain * passed / (spreading * 1.380649e-23 * system_k))
    for node, name in (("rf_receiver", "signal.link"), ("pointing_controller", "link")):
        assert station.parameters(node)[f"{name}.zenith_carrier_to_noise_db_hz"] == pytest.approx(level, abs=0.01)


@pytest.mark.parametrize(
    ("noise", "words"),
    [({"chain": [{"gain_db": 20.0}]}, r"chain\[0\] must have one of loss_db, noise_figure_db, noise_k"),
     ({"chain": [{"noise_k": 30.0, "loss_db": 1.0}]}, "must have one of"),
     ({"chain": [{"loss_db": 1.0, "gain_db": 3.0}]}, "gain_db=3.0: a part with loss_db has no gain of its own"),
     ({"chain": [{"loss_db": 70.0}]}, "loss_db=70.0 must be <= 60.0"), ({}, "noise.chain is missing")],
)  # fmt: skip
def test_a_chain_that_contradicts_itself_is_refused_by_name(noise: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        described(BAND={"noise": noise})
    with pytest.raises(ValueError, match="noise and system_noise_k give the same twice"):
        described(BAND={"noise": {"chain": CHAIN}, "system_noise_k": 100.0})
