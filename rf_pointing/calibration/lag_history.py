"""The lags of a mount that act on averaged rates of the beam, along the motion that the beam makes.

A bias model's lags x_v (s) and x_a (s^2) are those of steady motion.  A mount whose rates are
averaged over T = `averaging_s`,

    m = r / (1 + T s + T^2 s^2),      lag = x_v m + d m',      d = x_a + T x_v,

has them once its motion is steady (m = r - T r' + ...), has none when it starts from rest, and
keeps those of a fast turn for several T.  A model without an acceleration lag leaves that to the
average: d = 0.  Between samples r is a straight line, for which the average is known exactly: m = r
- T r', m' = r' and a decaying oscillation.
"""

import math
from typing import NamedTuple

import numpy as np

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.terms import numbered
from rf_pointing.core.types import Array, Pair

Averages = tuple[float, float, float, float]
# Steps in which a motion that nobody saw is assumed.
UNSEEN_STEP_S = 0.1
# Times of the average after which a motion has left no trace.
FORGOTTEN_TIMES = 20.0


class LagState(NamedTuple):
    """Rates (rad/s) of the beam at `t_s`, their average, and how fast that changes (rad/s^2)."""

    t_s: float
    rate: Pair
    mean: Pair = (0.0, 0.0)
    slope: Pair = (0.0, 0.0)


class LagHistory:
    """Lags of one mount, in its axis angles; raises ValueError for `averaging_s` <= 0."""

    def __init__(self, model: BiasModel, averaging_s: float) -> None:
        if not averaging_s > 0.0:
            raise ValueError(f"averaging_s={averaging_s} must be > 0")
        lags = np.array(numbered(model.coefficients, 6, 13, 7, 14))
        self._time_s = averaging_s
        self._velocity_s, acceleration_s2 = lags[:2], lags[2:]
        # x_a = 0 says "not fitted": adding T x_v to it would plan a lag that nobody has measured.
        self._damping_s2 = np.where(
            acceleration_s2 == 0.0, 0.0, acceleration_s2 + averaging_s * self._velocity_s
        )

    def along(
        self, t_s: Array, rate_rad_s: Array, acceleration_rad_s2: Array,
        before: LagState | None = None,
    ) -> tuple[tuple[Array, Array, Array], list[LagState]]:  # fmt: skip
        """Return by what the axes must lead a beam that moves like this, and the states.

        Parameters
        ----------
        t_s, rate_rad_s, acceleration_rad_s2
            Rising times (n,) and the motion of the beam (n, 2) at them.
        before
            State at the first time or earlier; None for a beam that was at rest until then.

        Returns
        -------
        position (rad), velocity and acceleration (n, 2), and n states to go on from.
        """
        rates = rate_rad_s.tolist()
        found = self._averages(t_s.tolist(), rates, before)
        rows = zip(t_s.tolist(), rates, found, strict=True)
        states = [LagState(t, (rate[0], rate[1]), row[:2], row[2:]) for t, rate, row in rows]
        return self._lead(rate_rad_s, acceleration_rad_s2, found), states

    def lead(
        self, t_s: Array, rate_rad_s: Array, acceleration_rad_s2: Array
    ) -> tuple[Array, Array, Array]:
        """Return what `along` returns first, for a beam that was at rest before the first time."""
        found = self._averages(t_s.tolist(), rate_rad_s.tolist(), None)
        return self._lead(rate_rad_s, acceleration_rad_s2, found)

    def _lead(
        self, rate_rad_s: Array, acceleration_rad_s2: Array, averages: list[Averages]
    ) -> tuple[Array, Array, Array]:
        mean, slope = np.hsplit(np.array(averages), 2)
        bend = (rate_rad_s - mean) / self._time_s**2 - slope / self._time_s
        jerk = (acceleration_rad_s2 - slope) / self._time_s**2 - bend / self._time_s
        x, d = self._velocity_s, self._damping_s2
        return x * mean + d * slope, x * slope + d * bend, x * bend + d * jerk

    def dragged(self, t_s: float, axis_rate_rad_s: Array, before: LagState | None) -> LagState:
        """Return the state at `t_s` from the rate (2,) of the axes: the beam lags by x_v m'."""
        slope = np.array(before.slope) if before else np.zeros(2)
        east, up = (axis_rate_rad_s - self._velocity_s * slope).tolist()
        # Nothing is known of the time before: at rest is the usual state of an antenna.
        if before is None:
            return LagState(t_s, (east, up))
        (row,) = self._averages([t_s], [[east, up]], before)
        return LagState(t_s, (east, up), row[:2], row[2:])

    def stopped(
        self, t_s: float, axis_rate_rad_s: Array, moved_rad: Array, before: LagState
    ) -> LagState:
        """Return the state at `t_s` of axes that moved by `moved_rad` (2,) since, unseen.

        They went on at the rate of `before` for as long as that takes, and then stopped.
        """
        if t_s - before.t_s > FORGOTTEN_TIMES * self._time_s:
            return LagState(t_s, before.rate)
        since_s, rate, state = t_s - before.t_s, np.array(before.rate), before
        moving_s = np.where(
            rate * moved_rad > 0.0, np.abs(moved_rad) / np.maximum(np.abs(rate), 1e-9), 0.0
        )
        for after_s in np.linspace(0.0, since_s, math.ceil(since_s / UNSEEN_STEP_S) + 1)[1:-1]:
            state = self.dragged(
                before.t_s + float(after_s), np.where(after_s <= moving_s, rate, 0.0), state
            )
        return self.dragged(t_s, axis_rate_rad_s, state)

    def _averages(
        self, times: list[float], rates: list[list[float]], before: LagState | None
    ) -> list[Averages]:
        """Return the averages of both rates and how fast they change, at each time."""
        here = before or LagState(times[0], (rates[0][0], rates[0][1]))
        time_s, (dt_s, mm, ms, sm, ss), last_s = self._time_s, self._step(0.0), here.t_s
        steps: dict[float, tuple[float, float, float, float, float]] = {}
        (x, y), (x_mean, y_mean), (x_slope, y_slope) = here.rate, here.mean, here.slope
        found = []
        # Numbers and no objects: plans of a day run through here some million times.
        for t, (x_rate, y_rate) in zip(times, rates, strict=True):
            since_s, last_s = t - last_s, t
            if since_s == 0.0:
                # The rate may jump in no time; its average stays, to the last bit.
                x, y = x_rate, y_rate
                found.append((x_mean, y_mean, x_slope, y_slope))
                continue
            # Plans are evenly spaced, but for the rounding of their times.
            if abs(since_s - dt_s) > 1e-9:
                if since_s not in steps:
                    steps[since_s] = self._step(since_s)
                dt_s, mm, ms, sm, ss = steps[since_s]
            x_ramp, y_ramp = (x_rate - x) / dt_s, (y_rate - y) / dt_s
            # Off the ramp at its beginning, counted from its end.
            m, s = x_mean - x_rate + (time_s + dt_s) * x_ramp, x_slope - x_ramp
            n, r = y_mean - y_rate + (time_s + dt_s) * y_ramp, y_slope - y_ramp
            x, x_mean, x_slope = (
                x_rate, x_rate - time_s * x_ramp + mm * m + ms * s, x_ramp + sm * m + ss * s,
            )  # fmt: skip
            y, y_mean, y_slope = (
                y_rate, y_rate - time_s * y_ramp + mm * n + ms * r, y_ramp + sm * n + ss * r,
            )  # fmt: skip
            found.append((x_mean, y_mean, x_slope, y_slope))
        return found

    def _step(self, dt_s: float) -> tuple[float, float, float, float, float]:
        """Return the step and the four factors of the decaying oscillation over it."""
        # Poles (-1 +- j sqrt 3) / 2T of 1 + T s + T^2 s^2; one would leave a term in s^2 (0063).
        decay, swing = 0.5 / self._time_s, math.sqrt(0.75) / self._time_s
        size = math.exp(-decay * dt_s)
        cosine, sine = size * math.cos(swing * dt_s), size * math.sin(swing * dt_s) / swing
        return dt_s, cosine + decay * sine, sine, -sine / self._time_s**2, cosine - decay * sine


def without_lags(model: BiasModel) -> BiasModel:
    """Return the model of the same antenna at rest."""
    return model.replace(**{term.name: 0.0 for term in model.terms if term.kind == "lag"})
