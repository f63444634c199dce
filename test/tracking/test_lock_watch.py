"""Innovations of beam and error under the bank of filters.

The watch on monopulse: false locks are named within 2 s, right ones never.
"""

import copy
import itertools
import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, PointingError, random_stream
from rf_pointing.tracking import LockWatch, LockWatchParams
from rf_pointing.tracking.lock_watch import InnovationBank, LockWatchState

STEP_S, NOISE, WALK, CHANGE, DRIFT = 0.1, 0.2, 0.3, 0.05, 0.5


def innovations(gain: float, count: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Of a target as the model has it, followed by an integrator: (beam + error) (n,) complex, and its variances."""
    random = random_stream(4, f"innovation {gain}")

    def draw(sigma: float) -> complex:
        return sigma * complex(*random.standard_normal(2))

    target, velocity, wind, beam, bank, found = 0j, draw(DRIFT), 0j, 0j, None, []
    for k in range(count):
        error = target + wind - beam + draw(NOISE)
        if bank is None:
            bank = InnovationBank.begin(0.0, beam, error, np.array([NOISE**2]), DRIFT)
        else:
            bank, new, variance = bank.step(k * STEP_S, beam, error, np.array([NOISE**2]), np.array([WALK]), CHANGE)
            found.append((new[0, 0] + new[1, 0], variance[0]))
        beam += gain * error
        target, velocity = target + STEP_S * velocity, velocity + draw(CHANGE * math.sqrt(STEP_S))
        wind += draw(WALK * math.sqrt(STEP_S))
    values, variances = zip(*found, strict=True)
    return np.array(values), np.array(variances)


@pytest.mark.parametrize("gain", [0.0, 0.1, 0.5])
def test_innovations_are_white_and_of_the_stated_variance_whatever_the_loop_does(gain: float) -> None:
    """4000 of them on two axes: variance known to 1.6 %, correlation to 0.011."""
    values, variances = innovations(gain)
    scaled = values / np.sqrt(variances)
    assert 0.5 * np.mean(np.abs(scaled) ** 2) == pytest.approx(1.0, abs=0.05)
    for lag in (1, 2, 5):
        assert abs(0.5 * np.mean(scaled[lag:] * np.conj(scaled[:-lag]))) < 0.045


H = 17.0 * MDEG
CLUSTER_S = 0.1
SIGMA = 0.14 * MDEG


def sensed(
    t_s: float, value: complex, level_db_hz: float = 45.0, valid: bool = True, sigma: float = SIGMA
) -> PointingError:
    return PointingError(
        t_s=t_s, sensor="monopulse", cross_elevation_rad=value.real, elevation_rad=value.imag,
        covariance_rad2=np.eye(2) * sigma**2, carrier_to_noise_db_hz=level_db_hz, valid=valid,
        reason="" if valid else "no lock",
    )  # fmt: skip


def close_loop(
    response: complex, start: complex, bandwidth_hz: float, seconds: float, name: str = "loop"
) -> tuple[str, float]:
    """Integrate a sensed error -> beam with this sensor response; return the first fault and its time."""
    rng = random_stream(12, name)
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    beam, target = 0j, start
    for k in range(round(seconds / CLUSTER_S)):
        t_s = k * CLUSTER_S
        noise = complex(*rng.standard_normal(2)) * SIGMA
        wind = complex(*rng.standard_normal(2)) * 0.1 * MDEG
        error = response * (target - beam - wind) + noise
        fault = watch.add(sensed(t_s, error), beam.real, beam.imag)
        if fault:
            return fault, t_s
        beam += 2.0 * math.pi * bandwidth_hz * CLUSTER_S * error
    return "", seconds


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("bandwidth_hz", [0.04, 0.3])
def test_right_sensor_is_never_doubted_in_two_minutes(seed: int, bandwidth_hz: float) -> None:
    assert close_loop(1.0, complex(5.0, -3.0) * MDEG, bandwidth_hz, 120.0, f"right {seed}") == ("", 120.0)


@pytest.mark.parametrize("bandwidth_hz", [0.04, 0.1, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_flipped_sign_is_found_within_two_seconds(bandwidth_hz: float, seed: int) -> None:
    fault, t_s = close_loop(-1.0, complex(4.0, 3.0) * MDEG, bandwidth_hz, 10.0, f"flip {seed}")
    assert fault.startswith("sign flip: the error grows while it is corrected")
    assert t_s <= 2.0


def follow_gusts(
    seconds: float, gust_mdeg: float, name: str, params: LockWatchParams | None = None, flip_s: float = math.inf
) -> tuple[str, float]:
    """Let the loop follow a wind that stays for a second and that the encoders do not see; return fault and its time."""
    params = params or LockWatchParams(half_power_beamwidth_rad=H)
    watch = LockWatch(params)
    rng, beam, gust = random_stream(12, name), 0j, 0j
    keep = math.exp(-CLUSTER_S)
    for k in range(round(seconds / CLUSTER_S)):
        t_s = k * CLUSTER_S
        gust = keep * gust + math.sqrt(1.0 - keep**2) * gust_mdeg * MDEG * complex(*rng.standard_normal(2))
        seen = beam + probe(params, t_s)
        error = (gust - seen) * (-1.0 if t_s >= flip_s else 1.0) + complex(*rng.standard_normal(2)) * SIGMA
        fault = watch.add(sensed(t_s, error), seen.real, seen.imag)
        if fault:
            return fault, t_s
        beam += 2.0 * math.pi * 0.2 * CLUSTER_S * (error + probe(params, t_s))
    return "", seconds


def probe(params: LockWatchParams, t_s: float) -> complex:
    return 0j if params.probe is None else complex(*params.probe.offset(t_s)[:2])


@pytest.mark.parametrize(("gust_mdeg", "seconds"), [(0.1, 200.0), (0.3, 600.0), (0.6, 200.0)])
def test_a_loop_that_follows_gusts_is_no_sign_flip(gust_mdeg: float, seconds: float) -> None:
    """Gusts that come back look like one to a watch that takes them for a wind ten times weaker."""
    assert follow_gusts(seconds, gust_mdeg, "gusts") == ("", seconds)
    calm = LockWatchParams(half_power_beamwidth_rad=H, gust_rad=(0.1 * gust_mdeg * MDEG,), vibration_rad=(0.0,))
    assert follow_gusts(600.0, gust_mdeg, "gusts", calm)[0].startswith(("sign flip", "phase"))


def test_without_a_probe_half_of_the_flips_under_a_beam_at_rest_are_found_within_two_seconds() -> None:
    """The error is that of wind and noise, 0.2 mdeg, when the sign changes, and grows e-fold in 0.8 s."""
    found = [follow_gusts(60.0, 0.1, f"rest {seed}", flip_s=50.0) for seed in range(8)]
    assert all(fault.startswith(("sign flip", "phase")) for fault, _ in found)
    times = np.array([t_s - 50.0 for _, t_s in found])
    assert np.all(times > 0.0)
    assert np.median(times) <= 2.0
    assert np.max(times) <= 2.5


PROBED = LockWatchParams(half_power_beamwidth_rad=H, probe_rad=0.2 * MDEG)


def test_a_probe_somewhat_larger_than_the_noise_finds_every_flip_within_two_seconds() -> None:
    """Also those for which a beam at rest gives no reason for three seconds."""
    found = [follow_gusts(30.0, 0.1, f"rest {seed}", PROBED, flip_s=20.0) for seed in range(12)]
    assert all(fault.startswith(("sign flip", "phase")) for fault, _ in found)
    times = np.array([t_s - 20.0 for _, t_s in found])
    assert np.all(times > 0.0)
    assert np.max(times) <= 2.0


@pytest.mark.parametrize(("gust_mdeg", "seconds"), [(0.1, 100.0), (0.3, 200.0), (0.6, 100.0)])
def test_a_right_lock_that_is_probed_is_not_doubted(gust_mdeg: float, seconds: float) -> None:
    assert follow_gusts(seconds, gust_mdeg, "gusts", PROBED) == ("", seconds)


def test_a_probe_beyond_the_middle_of_the_beam_is_refused() -> None:
    with pytest.raises(ValueError, match=r"probe_rad=.* must be <= .*, 0.1 half_power_beamwidth_rad"):
        LockWatchParams(half_power_beamwidth_rad=H, probe_rad=0.11 * H)


def follow_settling(name: str, params: LockWatchParams) -> str:
    """Let the loop follow a swing of 8 mdeg, 6 s and a decay of 5 s, as of lags of the mount; return the fault."""
    rng, beam, watch, errors = random_stream(12, name), 0j, LockWatch(params), [0j] * 5
    for k in range(300):
        t_s = k * CLUSTER_S
        target = (
            8.0 * MDEG * math.exp(-t_s / 5.0) * complex(math.sin(t_s * math.pi / 3.0), math.cos(t_s * math.pi / 3.0))
        )
        circle = probe(params, t_s)
        errors.append(target - beam + complex(*rng.standard_normal(2)) * 5.0 * SIGMA)
        fault = watch.add(
            sensed(t_s, errors[-1] - circle, sigma=5.0 * SIGMA), (beam + circle).real, (beam + circle).imag
        )
        if fault:
            return fault
        beam += 2.0 * math.pi * 0.1 * CLUSTER_S * errors[-5]
    return ""


@pytest.mark.parametrize("seed", range(4))
def test_lags_that_settle_are_no_sign_flip(seed: int) -> None:
    """To a watch that knows only steady targets they are."""
    x_band = LockWatchParams(half_power_beamwidth_rad=65.0 * MDEG)
    assert follow_settling(f"settle {seed}", x_band) == ""
    assert follow_settling(f"settle {seed}", x_band.replace(probe_rad=0.75 * MDEG)) == ""
    steady = x_band.replace(drift_change_rad_s=x_band.drift_change_rad_s[:1])
    assert follow_settling(f"settle {seed}", steady).startswith("sign flip")


@pytest.mark.parametrize("name", ["cross-elevation", "elevation"])
def test_flip_of_one_channel_names_its_axis(name: str) -> None:
    """Only the difference channel of that axis has changed its sign: no rotation explains it."""
    rng, watch, beam, found = random_stream(12, name), LockWatch(LockWatchParams(half_power_beamwidth_rad=H)), 0j, ""
    for k in range(20):
        miss = (4.0 + 4.0j) * MDEG - beam
        error = -miss.conjugate() if name == "cross-elevation" else miss.conjugate()
        error += complex(*rng.standard_normal(2)) * SIGMA
        found = found or watch.add(sensed(k * CLUSTER_S, error), beam.real, beam.imag)
        beam += 2.0 * math.pi * 0.1 * CLUSTER_S * error
    assert found == f"sign flip: the error grows while it is corrected, in {name}"


def test_sidelobe_slope_is_found_within_two_seconds() -> None:
    fault, t_s = close_loop(5.0, complex(1.0, 0.5) * MDEG, 0.04, 10.0)
    assert fault.startswith("sidelobe: the error changes")
    assert t_s <= 2.0


def test_turned_phase_is_found_within_two_seconds() -> None:
    fault, t_s = close_loop(np.exp(1.5j), complex(5.0, 2.0) * MDEG, 0.1, 10.0)
    assert fault.startswith("phase: the error is turned by")
    assert t_s <= 2.0


def test_level_far_below_the_link_with_a_small_error_is_a_sidelobe_after_three_clusters() -> None:
    """One cluster alone may be the end of the carrier."""
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    faults = [
        watch.add(sensed(0.1 * k, error_mdeg * MDEG, 45.0), 0.0, 0.0, expected_carrier_to_noise_db_hz=expected)
        for k, (error_mdeg, expected) in enumerate(
            [(1.0, 62.6), (1.0, 62.6), (8.0, 62.6), (1.0, 50.0), (1.0, 62.6), (1.0, 62.6), (1.0, 62.6)]
        )
    ]
    assert faults == [""] * 6 + ["sidelobe: C/N0 is 17.6 dB below the link's with a small error"]


def test_beam_at_rest_gives_no_verdict() -> None:
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    for k in range(30):
        assert watch.add(sensed(k * CLUSTER_S, 3.0 * MDEG), 0.0, 0.0) == ""
    assert max(watch.state.sums) == pytest.approx(0.0, abs=1e-9)


def test_no_single_cluster_decides() -> None:
    """A glitch of beam and error as of a flip, a hundred times the noise, counts for a third of a verdict."""
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    for k in range(20):
        assert watch.add(sensed(k * CLUSTER_S, 0j), 0.0, 0.0) == ""
    assert watch.add(sensed(20 * CLUSTER_S, 14.0 * MDEG + 0j), 14.0 * MDEG, 0.0) == ""
    assert max(watch.state.sums) == pytest.approx(watch.params.evidence / 3.0)


def test_after_a_gap_the_watch_begins_again() -> None:
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    for k in (0, 1, 2, 30):
        watch.add(sensed(k * CLUSTER_S, complex(0.3 * k) * MDEG), 0.3 * k * MDEG, 0.0)
        assert (max(watch.state.sums) > 0.0) == (k in (1, 2))


def test_invalid_errors_are_not_used() -> None:
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=H))
    watch.add(sensed(0.0, 1.0 * MDEG, valid=False), 0.0, 0.0)
    assert watch.state.rows == ()


def test_copied_state_continues_identically_and_reset_forgets() -> None:
    watch, twin = LockWatch(LockWatchParams()), LockWatch(LockWatchParams())
    for k in range(5):
        watch.add(sensed(k * CLUSTER_S, complex(5.0 - k, 0.3 * k) * MDEG), k * MDEG, 0.0)
    twin.state = copy.deepcopy(watch.state)
    for each in (watch, twin):
        each.add(sensed(0.5, 0j), 5.0 * MDEG, 0.0)
    assert watch.state.sums == twin.state.sums
    assert watch.state.weather == twin.state.weather
    assert watch.response() == twin.response()
    watch.reset()
    assert watch.state == LockWatchState()


def test_evidence_and_weather_are_bayes_rule_over_every_weather_of_each_response() -> None:
    """Written out with a filter of its own for beam and error in each weather, by matrices."""
    params = LockWatchParams(
        half_power_beamwidth_rad=H, gust_rad=(2e-6, 7e-6), vibration_rad=(0.0, 4e-6), drift_change_rad_s=(1e-6, 5e-5),
        settling_share=0.2, drift_rad_s=2e-5, weather_s=3.0, fade_s=5.0, evidence=60.0,
    )  # fmt: skip
    watch, rng = LockWatch(params), random_stream(9, "bayes")
    weathers = list(itertools.product(params.gust_rad, params.vibration_rad, params.drift_change_rad_s))
    usual = np.array([1.0 if wander == 1e-6 else 0.2 for *_, wander in weathers])
    usual /= usual.sum()
    turn = np.exp(2j * math.pi / 3.0)
    responses = [(1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-1.0, 0.0), (turn, 0.0), (np.conj(turn), 0.0)]
    known, sums = np.tile(usual, (6, 1)), np.zeros(6)
    filters, last_s = [], 0.0
    for k, t_s in enumerate((3.0, 3.1, 3.3, 3.4, 3.8, 3.9, 4.7)):
        beam, value = (3e-6 * complex(*rng.standard_normal(2)) for _ in range(2))
        noise = (2e-6 + 1e-6 * k) ** 2
        watch.add(sensed(t_s, value, sigma=math.sqrt(noise)), beam.real, beam.imag)
        if k == 0:
            for _, shake, wander in weathers:
                spread = np.diag([noise + shake**2, max(2e-5, wander) ** 2])
                filters.append(([np.array([beam, 0j]), np.array([value, 0j])], spread))
            last_s = t_s
            continue
        dt, last_s = t_s - last_s, t_s
        move, joint = np.array([[1.0, dt], [0.0, 1.0]]), np.zeros((6, len(weathers)))
        for w, (gust, shake, wander) in enumerate(weathers):
            places, spread = filters[w]
            change = wander**2 * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
            spread = move @ spread @ move.T + change + np.diag([gust**2 * dt, 0.0])
            variance = spread[0, 0] + noise + shake**2
            new = [found - (move @ place)[0] for found, place in zip((beam, value), places, strict=True)]
            gain = spread[:, 0] / variance
            places = [move @ place + gain * each for place, each in zip(places, new, strict=True)]
            filters[w] = places, spread - np.outer(gain, spread[0])
            for r, (direct, mirrored) in enumerate(responses):
                left = new[1] + direct * new[0] + mirrored * np.conj(new[0])
                joint[r, w] = known[r, w] * math.exp(-0.5 * abs(left) ** 2 / variance) / variance
        explained = joint.sum(axis=1)
        stays = math.exp(-dt / 3.0)
        known = stays * joint / explained[:, None] + (1.0 - stays) * usual
        says = np.minimum(np.log(explained / explained[0]), 60.0 / 3.0)
        sums = np.maximum(0.0, math.exp(-dt / 5.0) * sums + says)
        np.testing.assert_allclose(watch.state.sums, sums, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(watch.state.weather, known, rtol=1e-6)
    assert np.count_nonzero(sums) >= 2


def test_a_watch_without_a_strength_of_any_weather_is_refused_and_its_probe_is_a_circle() -> None:
    for name in ("gust_rad", "vibration_rad", "drift_change_rad_s"):
        with pytest.raises(ValueError, match=f"{name} has 0 strengths, must have at least 1"):
            LockWatchParams(**{name: ()})
    assert LockWatchParams().probe is None
    circle = LockWatchParams(probe_rad=1e-5, probe_period_s=1.5, probe_ramp_s=0.7).probe
    assert (circle.radius_rad, circle.period_s, circle.ramp_s) == (1e-5, 1.5, 0.7)
    assert LockWatchParams(half_power_beamwidth_rad=H, probe_rad=0.099 * H).probe.radius_rad == 0.099 * H
