"""Wind torque from what it did to the loops: the rate commands of a pass against those of a calm.

The recorded trajectories are followed once more without wind.  What the position law commanded
otherwise is its answer to the wind, through the loop that is known:

    u - u_calm = H w + n,   H = -K W / (1 + K P)
    w = S conj(H) / (|H|^2 S + N) (u - u_calm),   var w = integral of S N / (|H|^2 S + N)

K is the law from encoder error to rate, P and W the responses of the encoder to rate command and
torque, N what encoder steps and noise of both runs do to u, folded by the rate of the status.  S
has the shape of Davenport's spectrum, and the size that explains u.  The stated sigma is that of
this estimate; an antenna that is not the described one is not in it, and shows as what the
estimate leaves unexplained.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from rf_pointing.controllers import load_lqg_designs
from rf_pointing.controllers.margins import sampled_response
from rf_pointing.core import AXES
from rf_pointing.core.types import Array, ComplexArray
from rf_pointing.servo import RecordedWind, WindParams
from rf_pointing.simulation.open_loop import Signals, followed
from rf_pointing.simulation.pass_simulation import StationSetup
from rf_pointing.station.antenna.axis_response import AS_KNOWN, AxisResponse, davenport_psd
from rf_pointing.station.antenna.loops import BY_DRIVE, LQG, Law
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna

USUAL_WIND_M_S, USUAL_DRAG = 8.0, 0.005
# Steps of the status: over longer gaps the law's answer is not known.
LONGEST_STEP_S = 0.2
FOLDS = (-2, -1, 0, 1, 2)


@dataclass(frozen=True)
class GustEstimate:
    """Torque (n, 2) in N m of azimuth and elevation at `t_s` (n,), with its sigma (2,).

    `explained` is the share of the variance of the law's answer (2,) that the torque explains.
    """

    t_s: Array
    torque_n_m: Array
    sigma_n_m: Array
    explained: Array

    def __str__(self) -> str:
        sizes = np.std(self.torque_n_m, axis=0)
        rows = zip(AXES, sizes, self.sigma_n_m, self.explained, strict=True)
        return "; ".join(
            f"{axis} {rms:.3g} N m rms ±{sigma:.2g}, {100.0 * share:.0f} % of them explained"
            for axis, rms, sigma, share in rows
        )  # fmt: skip


def missed_gusts_m_s(
    t_s: Array, velocity_m_s: Array, drag_coefficient: float
) -> tuple[float, float]:  # fmt: skip
    """Return the mean of measured speeds (n, 2), and the rms of the gusts between two records.

    By Davenport's spectrum beyond half the rate of the records.
    """
    mean_m_s = float(np.mean(np.hypot(*velocity_m_s.T)))
    step_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 1e4
    beyond_hz = np.geomspace(0.5 / step_s, 1e3 / step_s, 500)
    gusts = davenport_psd(beyond_hz, max(mean_m_s, 0.1), drag_coefficient)
    return mean_m_s, float(np.sqrt(trapezoid(gusts, beyond_hz)))


def calm(params: WindParams) -> RecordedWind:
    """Return no wind at all."""
    return RecordedWind(params, 0.0, np.zeros(1), torque_n_m=np.zeros((1, 2)))


def estimated_gusts(setup: StationSetup, signals: Signals) -> GustEstimate:
    """Return the wind torque of a recorded pass.

    Raises ValueError where it cannot be known: a drive that closes its own loop, no rate commands,
    or a status with gaps.
    """
    params = AntennaParams(**setup.sets("antenna_servo"))
    antenna = setup.antenna()
    if missing := signals.missing("antenna_status", "joint_trajectory", "joint_states"):
        raise ValueError(f"the wind cannot be estimated without {missing}")
    if not isinstance(antenna, SimulatedAntenna) or params.loops.law == BY_DRIVE:
        raise ValueError("the wind cannot be estimated: the drive closes the position loop itself")
    # With the seed of the recording: then the noise of the encoders cancels where it is simulated.
    antenna.hardware.blow(calm(params.wind))
    recorded, still = _rates(signals.of("antenna_status")), _rates(followed(antenna, signals)[1])
    t_s = np.array(sorted(recorded.keys() & still.keys()))
    step_s = float(np.median(np.diff(t_s))) if len(t_s) > 2 else np.inf
    if not step_s <= LONGEST_STEP_S:
        raise ValueError(f"the wind cannot be estimated: antenna_status comes every {step_s:.2g} s")
    # A status that was lost costs a sample of the grid, not the estimate.
    grid = t_s[0] + step_s * np.arange(round((t_s[-1] - t_s[0]) / step_s) + 1)
    answer = np.array([recorded[t] - still[t] for t in t_s])
    rows = enumerate(np.interp(grid, t_s, column) for column in answer.T)
    columns = [_axis(params, axis, column, step_s) for axis, column in rows]
    torque, sigma, explained = (np.array(part) for part in zip(*columns, strict=True))
    return GustEstimate(grid, torque.T, sigma, explained)


def _rates(statuses: list[Any]) -> dict[float, Array]:
    return {each.t_s: np.asarray(each.rate_command_rad_s) for each in statuses}


def _axis(
    params: AntennaParams, axis: int, answer: Array, step_s: float
) -> tuple[Array, float, float]:  # fmt: skip
    """Return torque (n,), its sigma, and the explained share of the answer (n,) of one law."""
    plant, tick_s, count = params.plant, params.antenna.tick_s, len(answer)
    own = getattr(plant, AXES[axis])
    law = _law(params, axis)
    # Twice as long: what a filter knows of the end is not what came before the begin.
    frequency: Array = np.fft.rfftfreq(2 * count, step_s).astype(np.float64)
    # The integrators of plant and law are infinite at rest; their ratio is not.
    frequency[0] = 0.01 * frequency[1]

    def responses(at_hz: Array) -> tuple[ComplexArray, ComplexArray]:
        response = AxisResponse(plant, axis, AS_KNOWN, at_hz, tick_s)
        gain = sampled_response(law, at_hz, tick_s)[:, 0, 0]
        closed = gain / (1.0 + gain * response.from_command[:, 0])
        return closed, -closed * response.from_wind[:, 0] / own.inertia_kg_m2

    encoder_step = 2.0 * np.pi / 2**own.encoder_bits
    # The noise of both runs; the steps of an encoder are as good as uniform noise.
    variance = 2.0 * (encoder_step**2 / 12.0 + own.encoder_noise_rad**2)
    folded = [np.abs(frequency + fold / step_s) for fold in FOLDS]
    noise = variance * tick_s * sum(np.abs(responses(each)[0]) ** 2 for each in folded)
    through = responses(frequency)[1]
    spectrum = np.fft.rfft(answer, 2 * count) * step_s
    span_s = count * step_s
    power, shape = (
        np.abs(spectrum) ** 2 / span_s,
        davenport_psd(frequency, USUAL_WIND_M_S, USUAL_DRAG),
    )
    # The mean torque changes with the attitude, which no gust does: leave it almost free.
    shape[0] = 10.0 * shape[1]
    # By sums, not bin by bin: single bins of one record scatter by as much as they hold.
    size = np.sum(np.maximum(power - noise, 0.0)) / np.sum(np.abs(through) ** 2 * shape)
    prior = size * shape
    both = np.abs(through) ** 2 * prior + noise
    torque = np.fft.irfft(prior * np.conj(through) / both * spectrum, 2 * count)[:count] / step_s
    left = 2.0 * np.sum(prior * noise / both) / (2.0 * span_s)
    again = np.fft.irfft(np.abs(through) ** 2 * prior / both * spectrum, 2 * count)[:count] / step_s
    explained = 1.0 - float(np.var(answer - again)) / max(float(np.var(answer)), 1e-300)
    return torque, float(np.sqrt(left)), explained


def _law(params: AntennaParams, axis: int) -> tuple[Array, Array, Array, Array]:
    """Return the law of an axis from encoder error to rate command."""
    loops = params.loops
    gains: Sequence[Law] = loops.azimuth, loops.elevation
    designed = loops.law == LQG
    laws = load_lqg_designs(Path(loops.lqg_file) if loops.lqg_file else None) if designed else gains
    return laws[axis].matrices(params.antenna.tick_s)
