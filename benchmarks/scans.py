"""Scans: the estimator against its bound, a small dish on the Sun alone, and a night's bias model.

    scripts/run-python benchmarks/scans.py bound --trials 400    at the signals of a dish of 3.7 m
    scripts/run-python benchmarks/scans.py sun --trials 10       1.8 m at Ku band on the Sun alone
    scripts/run-python benchmarks/scans.py night --trials 200    14 terms from 25 scans

`bound` plants a source in total power and divides the scatter of the fitted offset by the
Cramer-Rao bound.  `sun` flies whole scans of a simulated station.  `night` flies 25 scans of Sun,
Moon, three radio sources and six satellites with a dish of 3.7 m, in S and then in X band, of which every term of
the mount's model is planted and the gears have 30 mdeg of play, fits a model to the table of
offsets and compares it with the truth in held-out directions; then it repeats the fit over trials
with the noise that the table states, and counts how often a term lies within its sigma.
"""

import argparse
import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import rf_pointing as rp
from rf_pointing.calibration import BiasModel, FitOptions, Observations, PassPriors, ReferenceTrack, fit_bias_model
from rf_pointing.calibration.fit_result import Prior
from rf_pointing.calibration.terms import TERM_NAMES
from rf_pointing.core import DAY_S, MDEG
from rf_pointing.core.dates import parse_utc, utc_text
from rf_pointing.core.target_motion import ANGLES
from rf_pointing.ephemeris import verification_elements
from rf_pointing.radiometry.disc import DiscResponse
from rf_pointing.radiometry.scan_fit import Samples, ScanFitParams, fit_scan
from rf_pointing.rf.beam import BeamParams
from rf_pointing.station.campaign.offset_table import read_offsets
from rf_pointing.station.campaign.plan import ArcRules, candidate_arcs
from rf_pointing.tracking.scan_program import ScanProgram, ScanProgramParams

SIGNALS = {"Cassiopeia A, S band": 2.8, "Moon, S band": 8.0, "20 K": 20.0, "Moon, X band": 75.0, "Sun, S band": 1400.0}
SYSTEM_K, BANDWIDTH_HZ, PERIOD_S = 150.0, 2.4e6, 0.1
KU = {
    "dish.diameter_m": 1.8, "bands.X.frequency_mhz": 11700.0, "bands.X.system_noise_k": 90.0,
    "simulation.mount_errors": {"azimuth_offset_deg": 0.25, "elevation_offset_deg": -0.2, "mislevel_north_deg": 0.1},
}  # fmt: skip
SUN_SFU = 380.0
"""Flux of the Sun that day at 11.7 GHz."""
TARGETS = (
    "Sun", "Moon", "Cassiopeia A", "Cygnus A", "Taurus A", "28057", "6251", "29141", "28129", "8195", "21897",
)  # fmt: skip
BEGIN, SCANS, EVERY_S = "2006-06-26T12:00:00", 25, 2400.0
LAGS = ("azimuth_velocity_lag", "azimuth_acceleration_lag", "elevation_velocity_lag", "elevation_acceleration_lag")
X_BEAM_DEG = 0.65
SOURCES, PASSES = ("Sun", "Moon", "Cassiopeia A", "Cygnus A", "Taurus A", "Virgo A"), 12


def bound(trials: int) -> None:
    """Print scatter over bound of both offsets, and mean over sigma, for each signal."""
    random, h = np.random.default_rng(1), math.radians(2.4)
    program = ScanProgram(ScanProgramParams(
        half_width_rad=1.5 * h, rate_rad_s=h / 4.0, move_rate_rad_s=0.6 * h, acceleration_rad_s2=0.6 * h, repetitions=1,
    ))  # fmt: skip
    t_s = np.arange(0.0, program.duration_s, PERIOD_S)
    x, y = np.array([program.offset(t)[:2] for t in t_s]).T
    beam, truth, ones = BeamParams(half_power_beamwidth_rad=h), (0.004, -0.007), np.ones_like(t_s)
    gain = DiscResponse(beam).pattern(np.hypot(truth[0] - x, truth[1] - y) / h)
    known = ScanFitParams(beam=beam, shape="width", pattern_error=0.0)
    relative = 1.0 / math.sqrt(BANDWIDTH_HZ * PERIOD_S)
    print("source                  T_A, K   sigma, mdeg   scatter / bound (across, up)   bias / its sigma")
    for name, kelvin in SIGNALS.items():
        fits = []
        for _ in range(trials):
            power = (SYSTEM_K + kelvin * gain) * (1.0 + relative * random.standard_normal(len(t_s)))
            fits.append(fit_scan(Samples(t_s, power, relative * power, x, y, ones, ones), known))
        offsets = np.array([fit.offset_rad for fit in fits])
        sigma = np.sqrt(np.mean([np.diagonal(fit.covariance)[:2] for fit in fits], axis=0))
        ratio = offsets.std(axis=0, ddof=1) / sigma
        bias = (offsets.mean(axis=0) - truth) / sigma * math.sqrt(trials)
        print(
            f"{name:22} {kelvin:7.1f}   {1e3 * np.degrees(sigma.mean()):11.2f}   {ratio[0]:14.3f} {ratio[1]:8.3f}"
            f"   {bias[0]:15.1f} {bias[1]:6.1f}"
        )


def sun(trials: int) -> None:
    """Print the errors of pointing and G/T of a dish of 1.8 m from the Sun alone."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ku.yaml"
        rp.Station("leo_3m7").description.write(file, KU)
        station = rp.Station(file, "X")
        signal = station.description.sets("rf_receiver", "X")["signal"]
        mount = station.description.sets("antenna_servo", "X")["mount"].model()
        away, merit, stated = [], [], 0.0
        for trial in range(trials):
            start_s = parse_utc("2026-03-20T07:00:00") + 1800.0 * trial
            found = station.scan(
                rp.elements("Sun"), start_t_s=start_s, seed=trial + 1, sun_flux_sfu=SUN_SFU, repetitions=1
            )
            place = np.array([[found.azimuth_rad], [found.elevation_rad]])
            needed = np.array(mount.offset_rad(*place, *np.zeros((4, 1))))[:, 0]
            stretch = np.array([math.cos(found.elevation_rad), 1.0])
            away.append(np.degrees((np.array(found.axis_offset_rad) - needed) * stretch))
            noise_k = found.figures.system_noise_k.value
            truth = signal.gain_dbi - 10.0 * math.log10(_noise_k(signal, found.elevation_rad))
            merit.append(found.figures.g_over_t_db_k.value - truth)
            stated = found.figures.g_over_t_db_k.sigma
            print(f"{found.name} el {math.degrees(found.elevation_rad):5.1f}: {away[-1].round(4)} deg, {noise_k:.1f} K")
        worst = float(np.abs(away).max())
        print(
            f"beam {station.beamwidth_deg:.2f} deg: pointing error at most {worst:.4f} deg (0.1), G/T "
            f"{np.mean(merit):+.3f} dB, at most {np.abs(merit).max():.3f} dB (0.5), stated sigma {stated:.2f} dB"
        )


def _noise_k(signal: object, elevation_rad: float) -> float:
    from rf_pointing.rf.noise import system_noise_k

    return float(system_noise_k(signal.noise, signal.atmosphere, elevation_rad))


def planted() -> BiasModel:
    """Return a mount with every term, angles of 0.1 to 0.5 deg and lags of 50 ms."""
    random = np.random.default_rng(5)
    sizes = random.uniform(0.1, 0.5, len(TERM_NAMES)) * random.choice([-1.0, 1.0], len(TERM_NAMES))
    values = dict(zip(TERM_NAMES, np.radians(sizes).tolist(), strict=True))
    return BiasModel(values | dict.fromkeys(LAGS, 0.05))


def plant(file: Path, truth: BiasModel) -> None:
    """Write a dish of 3.7 m with the errors of a mount and 30 mdeg of play."""
    errors = {
        f"{name}_{'s2' if 'acceleration' in name else 's' if 'lag' in name else 'deg'}":
        value if "lag" in name else math.degrees(value) for name, value in truth.coefficients.items()
    }  # fmt: skip
    play = {f"mount.{axis}.backlash_deg": 0.03 for axis in ("azimuth", "elevation")}
    changes = {"simulation.mount_errors": errors, "simulation.along_track_offset_s": 0.0, **play}
    rp.Station("leo_3m7").description.write(file, changes)


def fly_night(station: rp.Station, table: Path) -> Observations:
    """Scan the targets in turn; return the offsets that the table holds, those of play included in their sigma."""
    at_s, done, given_up = parse_utc(BEGIN), 0, 0
    while done < SCANS and given_up < 2 * SCANS:
        name = TARGETS[(done + given_up) % len(TARGETS)]
        try:
            found = station.scan(
                rp.elements(name),
                start_t_s=at_s,
                seed=done + 1,
                repetitions=1,
                rate_deg_s=0.375 * station.beamwidth_deg,
            )
            found.append(table)
            print(found.__str__().splitlines()[0])
            done, at_s = done + 1, max(at_s, found.t_s - EVERY_S) + EVERY_S / 2.0
        except ValueError as error:
            given_up += 1
            print(f"{name} {utc_text(at_s)[:16]}: {str(error)[:90]}")
    print(f"{station.band} band: {done} scans, {given_up} given up")
    points = read_offsets(
        table, station.name, station.band, station.site, math.radians(station.beamwidth_deg),
        verification_elements(), 1e9,
    )  # fmt: skip
    # Play and the beam of the axes are not in the noise of the power.
    sigma = np.hypot(points.sigma_elevation_rad, math.radians(0.01))
    return replace(points, sigma_elevation_rad=sigma, sigma_azimuth_rad=sigma / np.cos(points.true_elevation_rad))


def night(trials: int) -> None:
    """Print how a model of a night's table differs from the mount in other directions, band after band.

    The X band is scanned with the model of the S band in force, since its beam is narrower than the errors.
    """
    truth, model, options = planted(), None, FitOptions(edit_sigma=0.0)
    priors = {name: Prior(0.0, 0.2 if "lag" in name else math.radians(0.3)) for name in TERM_NAMES}
    azimuth, high = (
        np.radians(part.ravel()) for part in np.meshgrid(np.arange(0.0, 360.0, 15.0), np.arange(15.0, 80.0, 5.0))
    )
    still = np.zeros((4, len(azimuth)))

    def residual_deg(model: BiasModel) -> float:
        apart = np.array(model.offset_rad(azimuth, high, *still)) - np.array(truth.offset_rad(azimuth, high, *still))
        return float(np.degrees(np.sqrt(np.mean((apart[0] * np.cos(high)) ** 2 + apart[1] ** 2))))

    for band in ("S", "X"):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "night.yaml"
            plant(file, truth)
            points = fly_night(rp.Station(file, band, model=model), Path(folder) / "offsets.csv")
        model = fit_bias_model(points, priors=priors, options=options).model
        print(
            f"{band} band: held-out residual {1e3 * residual_deg(model):.1f} mdeg rms on the sky, "
            f"without a model {1e3 * residual_deg(BiasModel.zero()):.0f}, a tenth of the X-band beam {100 * X_BEAM_DEG:.0f}"
        )
        random, within = np.random.default_rng(7), []
        clean = np.array(truth.offset_rad(
            points.true_azimuth_rad, points.true_elevation_rad, points.azimuth_rate_rad_s, points.elevation_rate_rad_s,
            points.azimuth_acceleration_rad_s2, points.elevation_acceleration_rad_s2,
        ))  # fmt: skip
        for _ in range(trials):
            noise = random.standard_normal((2, len(points)))
            drawn = replace(
                points,
                observed_azimuth_rad=points.true_azimuth_rad + clean[0] + noise[0] * points.sigma_azimuth_rad,
                observed_elevation_rad=points.true_elevation_rad + clean[1] + noise[1] * points.sigma_elevation_rad,
            )
            one = fit_bias_model(drawn, priors=priors, options=options)
            off = [one.model.coefficients[name] - truth.coefficients[name] for name in one.names]
            within.append(np.abs(off) / np.sqrt(np.diagonal(one.covariance)))
        shares = [float(np.mean(np.array(within) < limit)) for limit in (1.0, 2.0)]
        print(f"{trials} trials, 14 terms: {shares[0]:.1%} within one sigma (68), {shares[1]:.1%} within two (95)")


def _points(tracks: Sequence[ReferenceTrack], first: int, sigma_rad: float) -> Observations:
    """Return points without errors, a pass for each track."""
    return Observations.concatenate([
        Observations(
            station="34 m", band="X", t_s=one.t_s, pass_id=np.full(len(one.t_s), first + number),
            observed_azimuth_rad=one.azimuth_rad, observed_elevation_rad=one.elevation_rad,
            sigma_azimuth_rad=sigma_rad / np.cos(one.elevation_rad),
            sigma_elevation_rad=np.full(len(one.t_s), sigma_rad), range_m=one.range_m,
            range_rate_m_s=one.range_rate_m_s,
            **dict(zip(("true_azimuth_rad", "true_elevation_rad", *ANGLES[2:]), one.angles, strict=True)),
        )
        for number, one in enumerate(tracks)
    ])  # fmt: skip


def together(trials: int) -> None:
    """Print by what passes and sources together lower the sigma of each term of a dish of 34 m, against passes alone.

    Both have as many observations of 1 mdeg, of days that are drawn; an orbit of SGP4 is 1 km off in each pass.
    """
    own, random, ratios = rp.Station("dss13"), np.random.default_rng(1), []
    rules = ArcRules(spacing_s=15.0, fastest_rad_s=0.005)
    low = [one for one in verification_elements() if one.mean_motion_rad_s > 1e-3]
    for _ in range(trials):
        begin_s = parse_utc(BEGIN) + DAY_S * random.uniform(-1.0, 1.0)
        arcs, _ = candidate_arcs(low, own.site, begin_s, DAY_S, rules)
        passes = [arcs[each].track for each in random.permutation(len(arcs))[:PASSES]]
        half = _points([one.at(one.t_s[::2]) for one in passes], 0, MDEG)
        scanned, count = [], sum(len(one.t_s) // 2 for one in passes)
        while 2 * len(scanned) < count:
            # Two points of a scan, 20 s apart, of whatever is up.
            t_s = begin_s + DAY_S * random.uniform() + np.array([0.0, 20.0])
            look = own.track_of(rp.elements(str(random.choice(SOURCES)))).sample(t_s)
            if math.radians(10.0) < look.elevation_rad.min() and look.elevation_rad.max() < math.radians(85.0):
                scanned.append(ReferenceTrack.of(look))
        sources = _points(scanned, len(passes), MDEG)
        sigma = []
        for points in (_points(passes, 0, MDEG), Observations.concatenate([half, sources])):
            fit = fit_bias_model(points, pass_priors=PassPriors.of_orbit(1000.0), options=FitOptions(edit_sigma=0.0))
            sigma.append(np.sqrt(np.diagonal(fit.covariance)))
        ratios.append(sigma[1] / sigma[0])
    for name, ratio, worst in zip(fit.names, np.median(ratios, axis=0), np.max(ratios, axis=0), strict=True):
        print(f"{name:<28} sigma together {ratio:.2f} of that of passes alone, at most {worst:.2f} (0.5)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = {"bound": bound, "sun": sun, "night": night, "together": together}
    parser.add_argument("part", choices=parts)
    parser.add_argument("--trials", type=int, default=10)
    given = parser.parse_args()
    parts[given.part](given.trials)


if __name__ == "__main__":
    main()
