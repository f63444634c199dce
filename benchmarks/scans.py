"""Scans: the estimator against its bound, a small dish on the Sun alone, and a night's bias model.

    scripts/run-python benchmarks/scans.py bound --trials 400    at the signals of a dish of 3.7 m
    scripts/run-python benchmarks/scans.py sun --trials 10       1.8 m at Ku band on the Sun alone
    scripts/run-python benchmarks/scans.py night --trials 200    14 terms from 25 scans

`bound` plants a source in total power and divides the scatter of the fitted offset by the
Cramer-Rao bound.  `sun` flies whole scans of a simulated station.  `night` flies 25 scans of Sun,
Moon, three radio sources and six satellites with a dish of 3.7 m in S band, of which every term of
the mount's model is planted and the gears have 30 mdeg of play, fits a model to the table of
offsets and compares it with the truth in held-out directions; then it repeats the fit over trials
with the noise that the table states, and counts how often a term lies within its sigma.
"""

import argparse
import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import rf_pointing as rp
from rf_pointing.calibration import BiasModel, FitOptions, fit_bias_model
from rf_pointing.calibration.fit_result import Prior
from rf_pointing.calibration.terms import TERM_NAMES
from rf_pointing.core.dates import parse_utc, utc_text
from rf_pointing.ephemeris import verification_elements
from rf_pointing.radiometry.disc import DiscResponse
from rf_pointing.radiometry.scan_fit import Samples, ScanFitParams, fit_scan
from rf_pointing.rf.beam import BeamParams
from rf_pointing.station.campaign.offset_table import read_offsets
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


def night(trials: int) -> None:
    """Print how a model of a night's table differs from the mount in other directions."""
    truth = planted()
    with tempfile.TemporaryDirectory() as folder:
        file, table = Path(folder) / "night.yaml", Path(folder) / "offsets.csv"
        errors = {
            f"{name}_{'s2' if 'acceleration' in name else 's' if 'lag' in name else 'deg'}":
            value if "lag" in name else math.degrees(value) for name, value in truth.coefficients.items()
        }  # fmt: skip
        play = {f"mount.{axis}.backlash_deg": 0.03 for axis in ("azimuth", "elevation")}
        changes = {"simulation.mount_errors": errors, "simulation.along_track_offset_s": 0.0, **play}
        rp.Station("leo_3m7").description.write(file, changes)
        station = rp.Station(file, "S")
        at_s, done, given_up = parse_utc(BEGIN), 0, 0
        while done < SCANS and given_up < 2 * SCANS:
            name = TARGETS[(done + given_up) % len(TARGETS)]
            try:
                found = station.scan(rp.elements(name), start_t_s=at_s, seed=done + 1, repetitions=1, rate_deg_s=0.9)
                found.append(table)
                print(found.__str__().splitlines()[0])
                done, at_s = done + 1, max(at_s, found.t_s - EVERY_S) + EVERY_S / 2.0
            except ValueError as error:
                given_up += 1
                print(f"{name} {utc_text(at_s)[:16]}: {str(error)[:90]}")
        points = read_offsets(
            table, station.name, "S", station.site, math.radians(station.beamwidth_deg), verification_elements(), 1e9
        )
    priors = {name: Prior(0.0, 0.2 if "lag" in name else math.radians(0.3)) for name in TERM_NAMES}
    # Play and the beam of the axes are not in the noise of the power.
    options, play_rad = FitOptions(edit_sigma=0.0), math.radians(0.01)
    elevation = points.true_elevation_rad
    sigma = np.hypot(points.sigma_elevation_rad, play_rad)
    points = replace(points, sigma_elevation_rad=sigma, sigma_azimuth_rad=sigma / np.cos(elevation))
    fit = fit_bias_model(points, priors=priors, options=options)
    azimuth, high = (
        np.radians(part.ravel()) for part in np.meshgrid(np.arange(0.0, 360.0, 15.0), np.arange(15.0, 80.0, 5.0))
    )
    still = np.zeros((4, len(azimuth)))

    def residual_deg(model: BiasModel) -> float:
        apart = np.array(model.offset_rad(azimuth, high, *still)) - np.array(truth.offset_rad(azimuth, high, *still))
        return float(np.degrees(np.sqrt(np.mean((apart[0] * np.cos(high)) ** 2 + apart[1] ** 2))))

    print(
        f"{done} scans, {given_up} given up: held-out residual {1e3 * residual_deg(fit.model):.1f} mdeg rms on the sky, "
        f"without a model {1e3 * residual_deg(BiasModel.zero()):.0f}, a tenth of the X-band beam {100 * X_BEAM_DEG:.0f}"
    )
    random, within = np.random.default_rng(7), []
    clean = np.array(truth.offset_rad(
        points.true_azimuth_rad, elevation, points.azimuth_rate_rad_s, points.elevation_rate_rad_s,
        points.azimuth_acceleration_rad_s2, points.elevation_acceleration_rad_s2,
    ))  # fmt: skip
    for _ in range(trials):
        noise = random.standard_normal((2, len(points)))
        drawn = replace(
            points,
            observed_azimuth_rad=points.true_azimuth_rad + clean[0] + noise[0] * points.sigma_azimuth_rad,
            observed_elevation_rad=elevation + clean[1] + noise[1] * points.sigma_elevation_rad,
        )
        one = fit_bias_model(drawn, priors=priors, options=options)
        off = [one.model.coefficients[name] - truth.coefficients[name] for name in one.names]
        within.append(np.abs(off) / np.sqrt(np.diagonal(one.covariance)))
    shares = [float(np.mean(np.array(within) < limit)) for limit in (1.0, 2.0)]
    print(f"{trials} trials, 14 terms: {shares[0]:.1%} within one sigma (68), {shares[1]:.1%} within two (95)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = {"bound": bound, "sun": sun, "night": night}
    parser.add_argument("part", choices=parts)
    parser.add_argument("--trials", type=int, default=10)
    given = parser.parse_args()
    parts[given.part](given.trials)


if __name__ == "__main__":
    main()
