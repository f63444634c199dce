"""BWG sections III and V with the real receiver and tracker, and radio-loop requirements.

The experiments: averaging in the tracker, honesty of its covariance, false locks, dropouts.
"""

import math

import numpy as np

from rf_pointing.controllers import CommandPreprocessorParams, PositionLoopParams
from rf_pointing.core import MDEG, MonopulseCluster, random_stream
from rf_pointing.core.types import Array
from rf_pointing.papers.monopulse_dropouts import (
    AutotrackRadio,
    draw_dropouts,
    reacquisition_times_s,
)
from rf_pointing.papers.monopulse_loop import TICK_S, MonopulsePass, PlainRadio, fly
from rf_pointing.papers.row import Row
from rf_pointing.rf import (
    HALF_POWER_BEAMWIDTH_RAD,
    Beam,
    BeamParams,
    MonopulseFeed,
    MonopulseFeedParams,
    Receiver,
    ReceiverParams,
)
from rf_pointing.servo import dss13_plant
from rf_pointing.tracking import LockWatch, LockWatchParams, MonopulseParams, MonopulseTracker

BEAM_RAD = HALF_POWER_BEAMWIDTH_RAD["Ka"]
SAMPLE_S = 0.02
CLUSTER = 5
CLUSTER_S = CLUSTER * SAMPLE_S
LEVEL_DB_HZ = 45.0
HONESTY_RUNS = 1000
# BWG sections III and IV-B, and the bandwidth for the wind row.
PLAIN_HZ, NOTCHED_HZ, WIND_HZ = 0.04, 0.3, 0.2
DROPOUTS = 10


def averaging_gain_db(cutoff_hz: float, clusters: int, rng: np.random.Generator) -> float:
    """Return the fall of the error's variance from the last sample of a cluster to the tracker's
    average of it.

    The noise is flat from `cutoff_hz` to the Nyquist frequency of 25 Hz (BWG Fig. 25); 20 dB below
    the sum.
    """
    count = clusters * CLUSTER
    spectrum = np.fft.rfft(rng.standard_normal(count))
    # Noise above the cutoff only, as in BWG Fig. 25; its variance is set afterwards.
    spectrum[np.fft.rfftfreq(count, SAMPLE_S) < cutoff_hz] = 0.0
    noise = np.fft.irfft(spectrum, count)
    noise *= 0.1 / np.std(noise)
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=BEAM_RAD))
    errors = [
        tracker.measure(_clean_cluster(part)).cross_elevation_rad
        for part in noise.reshape(clusters, CLUSTER)
    ]
    # One sample of each cluster: what a tracker without averaging would have used.
    last = noise[CLUSTER - 1 :: CLUSTER] * BEAM_RAD / tracker.params.slope
    return 10.0 * math.log10(float(np.var(last) / np.var(errors)))


def averaging_limit_db(cutoff_hz: float) -> float:
    """Return that gain in closed form.

    1 / mean |sin(5 x) / (5 sin x)|^2, x = pi f T, over the band of the noise.
    """
    x = math.pi * SAMPLE_S * np.linspace(max(cutoff_hz, 1e-3), 0.5 / SAMPLE_S, 20001)
    passed = (np.sin(CLUSTER * x) / (CLUSTER * np.sin(x))) ** 2
    return -10.0 * math.log10(float(np.mean(passed)))


def _clean_cluster(difference: Array) -> MonopulseCluster:
    return MonopulseCluster(
        t_s=SAMPLE_S * np.arange(CLUSTER, dtype=np.float64),
        sum=np.ones(CLUSTER, dtype=np.complex128),
        difference_cross_elevation=difference.astype(np.complex128),
        difference_elevation=np.zeros(CLUSTER, dtype=np.complex128),
        carrier_to_noise_db_hz=60.0,
    )


def monopulse_normalised_errors(
    level_db_hz: float, error_rad: Array, runs: int, rng: np.random.Generator
) -> Array:
    """Return e^T C^-1 e / 2 of `runs` clusters of the live receiver and tracker, after 20 s for its
    noise estimate.
    """
    beam = BeamParams.for_band("Ka")
    receiver = Receiver(
        ReceiverParams(), Beam(beam), MonopulseFeed(MonopulseFeedParams(), beam), rng
    )
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=BEAM_RAD))
    # The tracker needs 20 s to learn its noise; before, the covariance is its prior.
    settling, values = 200, []
    for k in range(settling + runs):
        times = k * CLUSTER_S + SAMPLE_S * np.arange(CLUSTER)
        x, y = np.repeat(error_rad[:, None], CLUSTER, axis=1)
        error = tracker.measure(receiver.cluster(times, x, y, level_db_hz, SAMPLE_S))
        if k >= settling and error.valid:
            miss = np.array([error.cross_elevation_rad, error.elevation_rad]) - error_rad
            values.append(0.5 * float(miss @ np.linalg.solve(error.covariance_rad2, miss)))
    return np.array(values)


def false_lock_rad() -> float:
    """Return x of the stable false locks nearest to the axis, (+-x, +-x), of a uniform aperture.

    Both differences zero and rising, the sum a sidelobe.  The nulls on the axes (1.4 beamwidths
    out) are saddles: they attract along the axis and repel across it, so no loop stays on them.
    """
    feed = MonopulseFeed(MonopulseFeedParams(), BeamParams.for_band("Ka", "uniform"))
    angle = np.linspace(0.9, 1.3, 3001) * BEAM_RAD
    volts = feed.voltages(angle, angle)
    ratio = (volts.difference_cross_elevation / volts.sum).real
    # The jump at a null of the sum is excluded by the small difference.
    rising = (ratio[:-1] < 0.0) & (ratio[1:] > 0.0) & (np.diff(ratio) < 0.1)
    return float(angle[:-1][rising][0])


def sidelobe_lock_s(rng: np.random.Generator) -> tuple[str, float]:
    """Return what the watch says of a loop on a false lock of a uniform aperture, and when.

    Ka band, 60 dB-Hz on the main beam, integrator of 0.1 Hz, starting 0.5 mdeg from the false lock;
    an antenna that follows at once.  The watch compares C/N0 with the link's: the false lock is so
    steep that the beam hardly moves.
    """
    beam = BeamParams.for_band("Ka", "uniform")
    receiver = Receiver(
        ReceiverParams(), Beam(beam), MonopulseFeed(MonopulseFeedParams(), beam), rng
    )
    tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=BEAM_RAD))
    watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=BEAM_RAD))
    target, beam_at = np.array([false_lock_rad() + 0.5 * MDEG, false_lock_rad()]), np.zeros(2)
    for k in range(100):
        times = k * CLUSTER_S + SAMPLE_S * np.arange(1, CLUSTER + 1)
        x, y = np.repeat((target - beam_at)[:, None], CLUSTER, axis=1)
        error = tracker.measure(receiver.cluster(times, x, y, 60.0, SAMPLE_S))
        fault = watch.add(error, float(beam_at[0]), float(beam_at[1]), 60.0)
        if fault:
            return fault, float(times[-1])
        if error.valid:
            step = np.array([error.cross_elevation_rad, error.elevation_rad])
            beam_at = beam_at + 2.0 * math.pi * 0.1 * CLUSTER_S * step
    return "nothing found", math.inf


def rows(seed: int = 1) -> list[Row]:
    """Return the published numbers of monopulse and ours."""
    return [
        *_averaging_rows(seed),
        _honesty_row(seed),
        *_bandwidth_rows(seed),
        _wind_row(seed),
        *_false_lock_rows(seed),
        *_dropout_rows(seed),
    ]


def _averaging_rows(seed: int) -> list[Row]:
    # Streams of their own: the white row does not change when the coloured one does.
    white, coloured = (
        averaging_gain_db(f, 4000, random_stream(seed, f"averaging {f}")) for f in (0.0, 8.0)
    )
    # The printed 17 dB is beyond every cutoff: the maximum shows that no choice of band explains
    # it.
    best = max(averaging_limit_db(f) for f in np.arange(5.0, 15.0, 0.1))
    return [
        Row(
            "averaging of N = 5 in the live tracker, white noise", "BWG eq. (17)", 7.0, white, "dB", 0.35,
            remark=f"exact {averaging_limit_db(0.0):.2f} dB",
        ),
        Row(
            "the same, noise from 8 Hz to Nyquist", "BWG Fig. 27", 17.0, coloured, "dB", 1.0,
            due=(averaging_limit_db(8.0) - 0.35, averaging_limit_db(8.0) + 0.35) if best < 17.0 else None, remark=
            f"the mean of 5 samples at 50 Hz gives exactly {averaging_limit_db(8.0):.2f} dB for such noise, and at "
            f"most {best:.2f} dB for any cutoff; the published ratio of 50 is one simulated record",
        ),
    ]  # fmt: skip


def _honesty_row(seed: int) -> Row:
    rng = random_stream(seed, "monopulse honesty")
    values = monopulse_normalised_errors(
        LEVEL_DB_HZ, np.array([2.0, -1.0]) * MDEG, HONESTY_RUNS, rng
    )
    return Row(
        "monopulse: mean normalised squared error, 1000 runs, 45 dB-Hz", "required", 1.0, float(np.mean(values)), "1",
        1.96 / math.sqrt(HONESTY_RUNS),
        remark=f"{len(values)} of {HONESTY_RUNS} errors valid; C/N0 from the samples, 95 % interval",
    )  # fmt: skip


def _bandwidth_rows(seed: int) -> list[Row]:
    """Elevation error against program track; the satellite 10 ms off its ephemeris, no wind."""
    plain = MonopulsePass(
        plant=dss13_plant(ideal=True), loop=PositionLoopParams(notch_enabled=False), seed=seed
    )  # fmt: skip
    notched = MonopulsePass(plant=dss13_plant(ideal=True), seed=seed)
    # One antenna and one error of the ephemeris for all three; only the radio loop differs.
    program, without, with_notch = (
        fly(setup, PlainRadio(setup, bandwidth, LEVEL_DB_HZ)).rms_rad(setup.settle_s)[0][1]
        for setup, bandwidth in ((plain, 0.0), (plain, PLAIN_HZ), (notched, NOTCHED_HZ))
    )
    common = f"program track {program / MDEG:.2f} mdeg rms"
    return [
        Row(
            "elevation error, program track over monopulse, f_m = 0.04 Hz, no notch", "BWG section III", 2.0,
            float(program / without), "1", 0.0, bound=">=",
            remark=f"{common}, monopulse {without / MDEG:.3f}; our deviation is a constant time, theirs wobbles",
        ),
        Row(
            "the same, f_m = 0.3 Hz with the notch", "BWG section IV-B", 10.0, float(program / with_notch), "1", 0.0,
            bound=">=", remark=f"{common}, monopulse {with_notch / MDEG:.3f}, receiver noise at 45 dB-Hz included",
        ),
    ]  # fmt: skip


def _wind_row(seed: int) -> Row:
    # With the published 0.5 the encoder loop rings at 0.25 Hz in the gusts.
    setup = MonopulsePass(loop=PositionLoopParams(proportional_gain=1.0), wind_m_s=8.0, seed=seed)
    radio = PlainRadio(setup, WIND_HZ, LEVEL_DB_HZ)
    axes, radial = fly(setup, radio).rms_rad(setup.settle_s)
    return Row(
        "total radial error, Ka, 45 dB-Hz, wind 8 m/s, LEO pass", "required", 2.0, radial / MDEG, "mdeg rms", 0.0,
        bound="<=",
        remark=f"f_m = {WIND_HZ} Hz, notch, friction, play and encoders on; cross-elevation {axes[0] / MDEG:.2f}, "
        f"elevation {axes[1] / MDEG:.2f} mdeg; k_p = 1: with the published 0.5 the encoder loop rings at 0.25 Hz in "
        f"the gusts{'; ' + radio.fault if radio.fault else ''}",
    )  # fmt: skip


def _false_lock_rows(seed: int) -> list[Row]:
    setup = MonopulsePass(wind_m_s=8.0, seed=seed)
    # After the loop has settled: the watch must find the flip and not the pull-in.
    flip_at_s = 40.0
    radio = PlainRadio(setup, NOTCHED_HZ, LEVEL_DB_HZ, flip_s=flip_at_s)
    fly(setup, radio)
    cases = (
        ("sign flip in flight", radio.fault, radio.fault_s - flip_at_s),
        ("sidelobe lock", *sidelobe_lock_s(random_stream(seed, "sidelobe"))),
    )
    return [
        Row(f"{name}: time to detect", "required", 2.0, after_s, "s", 0.0, bound="<=", remark=fault)
        for name, fault, after_s in cases
    ]  # fmt: skip


def _dropout_rows(seed: int) -> list[Row]:
    setup = MonopulsePass(start_s=-180.0, end_s=150.0, late_s=0.05, wind_m_s=8.0, seed=seed)
    dropouts = draw_dropouts(setup, DROPOUTS)
    radio = AutotrackRadio(setup, NOTCHED_HZ, LEVEL_DB_HZ, dropouts)
    log = fly(setup, radio)
    times = reacquisition_times_s(radio.modes, dropouts)
    # Over the whole pass: the jumps to be excluded happen at changes of mode.
    steepest = float(np.max(np.abs(np.diff(log.command_velocity_rad_s, axis=0)))) / TICK_S
    limit = min(CommandPreprocessorParams().acceleration_limit_rad_s2)
    return [
        Row(
            "random dropouts of 0.5-20 s reacquired, Ka, 45 dB-Hz, wind 8 m/s", "required", DROPOUTS,
            float(np.sum(np.isfinite(times))), "of 10", 0.0,
            remark=f"slowest {np.max(times):.1f} s after the carrier is back, median {np.median(times):.1f} s",
        ),
        Row(
            "largest acceleration of the command over the pass", "required", math.degrees(limit),
            math.degrees(steepest), "deg/s^2", 1e-6, bound="<=",
            remark=f"the preprocessor's limit; {100.0 * np.mean(log.transparent):.1f} % of the commands passed unchanged",
        ),
    ]  # fmt: skip
