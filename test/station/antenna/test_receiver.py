"""The simulated receiver: clusters of boresights against the satellite's direction computed for each instant."""

import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, Boresight, sky_offset_rad
from rf_pointing.ephemeris import Pass, SatelliteAntennaParams, TopocentricTrack
from rf_pointing.rf import (
    HALF_POWER_BEAMWIDTH_RAD,
    AtmosphereParams,
    DropoutParams,
    InterferenceParams,
    Link,
    LinkParams,
    NoiseParams,
    SpinParams,
)
from rf_pointing.station.antenna.receiver import Reception, SignalParams, SimulatedReceiver
from rf_pointing.station.description import read_station
from rf_pointing.tracking.beam_fit import spin_columns

TICK_S = 0.02
SAME_RAD = 1e-7
"""Times of a block are even to `TIME_TOLERANCE_S`, in which the target moves by 1e-7 rad (0.006 mdeg)."""
PARAMS = SignalParams(link=LinkParams(zenith_carrier_to_noise_db_hz=60.0, reference_range_m=780e3))


def beam(track: TopocentricTrack, t_s: float, right_rad: float = 0.0, up_rad: float = 0.0) -> Boresight:
    """A beam that points beside the satellite, which is then to the left of and below it by these angles."""
    target = track.target_at(t_s)
    return Boresight(
        t_s=t_s,
        azimuth_rad=target.azimuth_rad + right_rad / math.cos(target.elevation_rad),
        elevation_rad=target.elevation_rad + up_rad,
    )


def received(receiver: SimulatedReceiver, track: TopocentricTrack, start_s: float, count: int) -> list[Reception]:
    beams = [
        beam(track, round(start_s + k * TICK_S, 6), 8 * MDEG * math.sin(0.05 * k), -6 * MDEG) for k in range(count)
    ]
    return [reception for sample in beams if (reception := receiver.take(sample)) is not None]


# The table of docs/math/link.md.
@pytest.mark.parametrize(
    ("band", "lna_k", "dichroic_k", "zenith_loss_db"),
    [("S", 4.0, 0.0, 0.035), ("X", 5.45, 0.0, 0.04), ("Ka", 45.0, 1.34, 0.14)],
)
def test_every_band_hears_through_its_own_beam_amplifier_and_sky(
    band: str, lna_k: float, dichroic_k: float, zenith_loss_db: float
) -> None:
    signal = read_station("dss13").sets("rf_receiver", band)["signal"]
    assert signal.beam.half_power_beamwidth_rad == pytest.approx(HALF_POWER_BEAMWIDTH_RAD[band])
    assert signal.noise == NoiseParams(lna_k=lna_k, dichroic_k=dichroic_k)
    assert signal.atmosphere == AtmosphereParams(zenith_loss_db=zenith_loss_db)


def test_a_cluster_holds_the_samples_between_two_receptions(track: TopocentricTrack, window: Pass) -> None:
    start_s = math.floor(window.tca_t_s) + TICK_S
    first, second = received(SimulatedReceiver(PARAMS, track), track, start_s, 10)
    np.testing.assert_allclose(first.cluster.t_s, start_s + TICK_S * np.arange(5), atol=1e-6)
    np.testing.assert_allclose(second.cluster.t_s, start_s + TICK_S * np.arange(5, 10), atol=1e-6)
    assert first.power.t_s == first.truth.t_s == pytest.approx(start_s + 4 * TICK_S, abs=1e-6)
    assert first.power.integration_s == pytest.approx(5 * TICK_S, abs=1e-6)


def test_a_gap_and_a_step_back_change_the_directions_not_the_sense(track: TopocentricTrack, window: Pass) -> None:
    """After any jump of time the block is computed anew."""
    receiver, start_s = SimulatedReceiver(PARAMS, track), math.floor(window.tca_t_s) + TICK_S
    for begin_s in (start_s, start_s + 33.0, start_s - 120.0):
        last = received(receiver, track, begin_s, 10)[-1].truth
        k = 9
        pointed, target = beam(track, last.t_s, 8 * MDEG * math.sin(0.05 * k), -6 * MDEG), track.target_at(last.t_s)
        right, up = sky_offset_rad(target.azimuth_rad, target.elevation_rad, pointed.azimuth_rad, pointed.elevation_rad)
        assert (last.cross_elevation_rad, last.elevation_rad) == pytest.approx((float(right), float(up)), abs=SAME_RAD)


def test_off_the_axis_the_difference_grows_and_the_carrier_weakens(track: TopocentricTrack, window: Pass) -> None:
    """A beam 8 mdeg left of the target, so the target is right of it: the real part of delta/sum is positive."""
    t_s = math.floor(window.tca_t_s) + TICK_S

    def ratio(right_rad: float) -> tuple[float, float]:
        receiver = SimulatedReceiver(PARAMS, track)
        receptions = [receiver.take(beam(track, round(t_s + k * TICK_S, 6), -right_rad)) for k in range(250)]
        clusters = [r.cluster for r in receptions if r is not None]
        sums, differences = (
            np.concatenate([getattr(c, n) for c in clusters]) for n in ("sum", "difference_cross_elevation")
        )
        power = np.mean([r.power.power_w for r in receptions if r is not None])
        return float(np.abs(np.vdot(sums, differences)) / np.vdot(sums, sums).real), float(power)

    centred, right = ratio(0.0), ratio(16.0 * MDEG)
    assert right[0] > centred[0] + 0.1
    # Gaussian beam: 12 (16/65)^2 = 0.73 dB.
    assert 10.0 * math.log10(right[1] / centred[1]) == pytest.approx(-12.0 * (16.0 / 65.0) ** 2, abs=0.15)


def test_one_seed_gives_the_same_samples_and_another_seed_others(track: TopocentricTrack, window: Pass) -> None:
    start_s = math.floor(window.tca_t_s) + TICK_S
    first, again, other = (
        received(SimulatedReceiver(PARAMS.replace(seed=seed), track), track, start_s, 20)[-1].cluster.sum
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def on_target(params: SignalParams, track: TopocentricTrack, start_s: float, count: int) -> list[Reception]:
    receiver = SimulatedReceiver(params, track)
    beams = [beam(track, round(start_s + k * TICK_S, 6)) for k in range(count)]
    return [reception for sample in beams if (reception := receiver.take(sample)) is not None]


def test_a_spinning_satellite_is_heard_in_the_carrier_power(track: TopocentricTrack, window: Pass) -> None:
    params = PARAMS.replace(spin=SpinParams(period_s=3.0, depth=0.3))
    heard = on_target(params, track, math.floor(window.tca_t_s) + TICK_S, 600)
    t_s, power_w = np.array([(r.power.t_s, r.power.power_w) for r in heard]).T
    relative = power_w / np.mean(power_w) - 1.0
    left = {}
    for period_s in (2.9, 3.0, 3.1):
        columns = spin_columns(t_s, (period_s,))
        fit = np.linalg.lstsq(columns, relative, rcond=None)[0]
        left[period_s] = np.var(relative - columns @ fit) / np.var(relative)
    assert min(left, key=left.__getitem__) == 3.0
    assert left[3.0] < 0.1


def test_an_interference_line_stands_in_the_differences_of_a_beam_on_the_target(
    track: TopocentricTrack, window: Pass
) -> None:
    """0.7 and 0.4 times as large in the differences as in the sum, which it shares with the carrier."""
    lines = [InterferenceParams(level_db_hz=level, frequency_offset_hz=7.0) for level in (55.0, -40.0)]
    ratios = []
    for line in lines:
        heard = on_target(PARAMS.replace(interference=line), track, math.floor(window.tca_t_s) + TICK_S, 100)
        sums, right, up = (
            np.concatenate([getattr(r.cluster, n) for r in heard])
            for n in ("sum", "difference_cross_elevation", "difference_elevation")
        )
        size = math.sqrt(float(np.mean(np.abs(sums) ** 2)))
        ratios.append([float(np.sqrt(np.mean(np.abs(part) ** 2))) / size for part in (right, up)])
    weaker = 10.0 ** ((55.0 - heard[-1].truth.carrier_to_noise_db_hz) / 20.0) * np.sinc(7.0 * TICK_S)
    level = weaker / math.sqrt(1.0 + weaker**2)
    assert ratios[0] == pytest.approx([0.7 * level, 0.4 * level], rel=0.05)
    assert max(ratios[1]) < 0.05


def test_the_level_is_that_of_link_and_satellite_s_antenna_towards_the_station(
    track: TopocentricTrack, window: Pass
) -> None:
    start_s = math.floor(window.tca_t_s) + TICK_S
    antenna = SatelliteAntennaParams(half_power_beamwidth_rad=math.radians(60.0))
    turned = track.with_offsets(along_track_offset_s=0.0, cross_track_offset_rad=0.0, antenna=antenna)
    link = Link(PARAMS.link, PARAMS.atmosphere, PARAMS.noise)
    for of in (track, turned):
        (reception,) = on_target(PARAMS, of, start_s, 5)
        now = of.target_at(reception.truth.t_s)
        expected = float(link.carrier_to_noise_db_hz(now.range_m, now.elevation_rad)) + now.satellite_gain_db
        assert reception.truth.carrier_to_noise_db_hz == pytest.approx(expected, abs=1e-6)
        assert reception.truth.sensor == "truth"
    assert now.satellite_gain_db < -3.0


def levels_of(params: SignalParams, track: TopocentricTrack, start_s: float, seconds: float) -> np.ndarray:
    """Seconds from the start and level of each cluster; where the beam points is not in the level."""
    receiver, times = SimulatedReceiver(params, track), start_s + TICK_S * np.arange(1, round(seconds / TICK_S) + 1)
    beams = (Boresight(t_s=round(float(t_s), 6), azimuth_rad=1.0, elevation_rad=0.5) for t_s in times)
    found = [reception for sample in beams if (reception := receiver.take(sample)) is not None]
    return np.array([(r.truth.t_s - start_s, r.truth.carrier_to_noise_db_hz) for r in found])


def test_dropouts_are_counted_from_the_first_reception_and_fall_within_their_time(
    track: TopocentricTrack, window: Pass
) -> None:
    """The satellite rises 5 s after the receiver has begun; no carrier is 0 dB-Hz."""
    few = DropoutParams(count=3, shortest_s=0.5, longest_s=1.0, gap_s=0.5)
    params = PARAMS.replace(dropouts=few, dropouts_after_s=4.0, dropouts_within_s=8.0)
    times = np.arange(math.floor(window.aos_t_s) - 200.0, window.aos_t_s, 0.1)
    horizon_s = float(times[np.argmax(track.sample(times).elevation_rad > 0.0)])
    start_s = math.floor(horizon_s) - 5.0
    first = levels_of(params, track, start_s, 18.0)
    seconds, lost = first[:, 0] - (horizon_s - start_s), first[:, 1] == 0.0
    assert lost[seconds < -0.1].all()
    assert not lost[(seconds > 0.1) & (seconds < 3.9)].any()
    assert not lost[seconds > 12.2].any()
    gaps = np.flatnonzero(np.diff(lost[seconds > 0.1].astype(int)) == 1)
    assert len(gaps) == 3
    assert 1.4 < 0.1 * np.sum(lost[seconds > 0.1]) < 3.1
    # Another seed has others; none are none.
    other = levels_of(params.replace(seed=2), track, start_s, 18.0)
    assert not np.array_equal(other[:, 1] == 0.0, lost)
    none = levels_of(params.replace(dropouts=few.replace(count=0)), track, start_s, 18.0)
    assert not (none[:, 1] == 0.0)[seconds > 0.1].any()


@pytest.mark.parametrize("after_s", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("phase_rad", [(0.0, 0.0), (0.4, -0.7)])
def test_a_feed_is_turned_over_at_the_time_that_is_set(
    track: TopocentricTrack, window: Pass, after_s: float, phase_rad: tuple[float, float]
) -> None:
    """Both differences; the phase of a cluster against the same one of a feed that is not."""
    strong = PARAMS.replace(
        link=PARAMS.link.replace(zenith_carrier_to_noise_db_hz=80.0),
        feed=PARAMS.feed.replace(difference_phase_rad=phase_rad),
    )
    start_s = math.floor(window.tca_t_s) + TICK_S
    plain, turned = (
        received(SimulatedReceiver(params, track), track, start_s, 200)
        for params in (strong, strong.replace(sign_flip_after_s=after_s))
    )
    for before, after in zip(plain, turned, strict=True):
        begun_s = float(before.cluster.t_s[0]) - start_s
        sign = -1.0 if after_s > 0.0 and begun_s >= after_s - 1e-6 else 1.0
        for name in ("difference_cross_elevation", "difference_elevation"):
            ratios = [
                np.vdot(c.sum, getattr(c, name)) / np.vdot(c.sum, c.sum).real for c in (before.cluster, after.cluster)
            ]
            assert abs(ratios[1] - sign * ratios[0]) < 0.02
    assert abs(ratios[0]) > 0.1
