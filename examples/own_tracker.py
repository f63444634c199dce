"""A tracker of your own tracks a simulated pass: scripts/run-python examples/own_tracker.py."""

from collections import deque

import numpy as np

import rf_pointing as rp
from rf_pointing.core import MDEG, MU, CarrierPower, PointingError
from rf_pointing.core.signals import BeamPosition
from rf_pointing.tracking.scan import CircleScan, ScanParams
from rf_pointing.tracking.sensors import SensorTraits, register

SCAN = CircleScan(ScanParams(radius_rad=6.0 * MDEG, period_s=4.0, ramp_s=2.0), age_s=2.0, bandwidth_hz=0.05)
TRAITS = SensorTraits(name="slope", scans=True, scan=SCAN)


class SlopeTracker(BeamPosition):
    """Fits P = a + b.u over the beam's positions u of one turn: the error is h^2 b / (2 mu a)."""

    def __init__(self) -> None:
        super().__init__()
        self._mode = ""
        self._rows: deque[list[float]] = deque(maxlen=40)

    def take_status(self, t_s: float, centre_rad: np.ndarray, _offset: np.ndarray, mode: str, _sensor: str) -> None:
        self._mode = mode
        self.take_centre(t_s, centre_rad)

    def take_power(self, power: CarrierPower) -> list[PointingError]:
        t_s = power.t_s - 0.5 * power.integration_s
        beam = self.offset(t_s)
        if self._mode == TRAITS.name and beam is not None:
            self._rows.append([power.power_w, 1.0, *beam.tolist()])
        error, full = np.zeros(2), len(self._rows) == self._rows.maxlen
        if full:
            rows = np.array(self._rows)
            mean, *slope = np.linalg.lstsq(rows[:, 1:], rows[:, 0], rcond=None)[0]
            error = (65.0 * MDEG) ** 2 / (2.0 * MU * mean) * np.array(slope)
        return [PointingError(
            t_s=t_s, sensor=TRAITS.name, cross_elevation_rad=float(error[0]), elevation_rad=float(error[1]), valid=full,
            covariance_rad2=full * MDEG**2 * np.eye(2), carrier_to_noise_db_hz=power.carrier_to_noise_db_hz,
        )]  # fmt: skip


def main() -> rp.SimulatedPass:
    """Register the tracker and track the part of a pass of CBERS-2 above 0.7 rad with it."""
    register(TRAITS)
    station = rp.Station("dss13", band="X")
    found = station.passes(rp.elements("CBERS 2"), days=2, mask_rad=0.7)[0]
    log = station.simulate(found, sensor=TRAITS.name, tracker=SlopeTracker())
    print(f"{np.sqrt(np.mean(log.errors_mdeg(TRAITS.name)[300:] ** 2)):.2f} mdeg rms per axis after 30 s of it")
    return log


if __name__ == "__main__":
    main()
