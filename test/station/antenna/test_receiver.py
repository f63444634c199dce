"""The simulated receiver: clusters of boresights against the satellite's direction computed for each instant."""

import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, Boresight, sky_offset_rad
from rf_pointing.core.parameters import NodeParameters
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.rf import (
    HALF_POWER_BEAMWIDTH_RAD,
    AtmosphereParams,
    InterferenceParams,
    LinkParams,
    NoiseParams,
    SpinParams,
)
from rf_pointing.station.antenna.receiver import BLOCK, Reception, SignalParams, SimulatedReceiver
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
    given = read_station("dss13").parameters("rf_receiver", band)
    signal = NodeParameters("rf_receiver", given).group("signal", SignalParams())
    assert signal.beam.half_power_beamwidth_rad == pytest.approx(HALF_POWER_BEAMWIDTH_RAD[band])
    assert signal.noise == NoiseParams(lna_k=lna_k, dichroic_k=dichroic_k)
    assert signal.atmosphere == AtmosphereParams(zenith_loss_db=zenith_loss_db)


def test_looking_ahead_in_blocks_gives_the_directions_of_the_instants(track: TopocentricTrack, window: Pass) -> None:
    start_s = math.floor(window.tca_t_s) + TICK_S
    receptions = received(SimulatedReceiver(PARAMS, track), track, start_s, 5 * BLOCK)
    assert len(receptions) == BLOCK
    for reception in receptions:
        t_s = reception.truth.t_s
        k = round((t_s - start_s) / TICK_S)
        pointed, target = beam(track, t_s, 8 * MDEG * math.sin(0.05 * k), -6 * MDEG), track.target_at(t_s)
        right, up = sky_offset_rad(target.azimuth_rad, target.elevation_rad, pointed.azimuth_rad, pointed.elevation_rad)
        assert reception.truth.cross_elevation_rad == pytest.approx(float(right), abs=SAME_RAD)
        assert reception.truth.elevation_rad == pytest.approx(float(up), abs=SAME_RAD)


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


def test_a_step_back_in_time_drops_the_begun_cluster(track: TopocentricTrack, window: Pass) -> None:
    receiver, start_s = SimulatedReceiver(PARAMS, track), math.floor(window.tca_t_s) + TICK_S
    assert received(receiver, track, start_s, 3) == []
    assert received(receiver, track, start_s - 10.0, 4) == []
    assert len(received(receiver, track, start_s - 10.0 + 4 * TICK_S, 1)) == 1


@pytest.mark.parametrize("before", [1, 2, 4])
def test_a_gap_in_a_cluster_starts_a_new_one(track: TopocentricTrack, window: Pass, before: int) -> None:
    """Samples of two sides of a gap in one cluster would put the satellite where it never was."""
    receiver, start_s = SimulatedReceiver(PARAMS, track), math.floor(window.tca_t_s) + TICK_S
    assert received(receiver, track, start_s, before) == []
    (reception,) = received(receiver, track, start_s + 3.0, 5)
    np.testing.assert_allclose(reception.cluster.t_s, start_s + 3.0 + TICK_S * np.arange(5), atol=1e-6)
    assert reception.truth.elevation_rad == pytest.approx(6 * MDEG, abs=0.01 * MDEG)


def test_below_the_horizon_there_is_no_signal(track: TopocentricTrack, window: Pass) -> None:
    reception = received(SimulatedReceiver(PARAMS, track), track, math.floor(window.aos_t_s) - 400.0 + TICK_S, 5)[0]
    assert track.target_at(reception.truth.t_s).elevation_rad < 0.0
    assert reception.truth.carrier_to_noise_db_hz == 0.0
    assert reception.cluster.carrier_to_noise_db_hz < 25.0


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
