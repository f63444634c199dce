"""Fly passes with every sensor and band, and print the certificate's expected loss beside the flown one.

scripts/run-python benchmarks/predicted_loss.py [--plan] [BAND,SENSOR,PEAK ...]

BAND is S, X or Ka, PEAK the least elevation of the pass in deg (88 finds one near the zenith).  The
station is the simulated DSS-13 with its commissioning model, the satellite CBERS-2.  --plan prints the
certificates alone.  Flown is the true error of every cluster from AOS to LOS, by `core/pass_outcome.py`;
counted is what the controller made of axes, sensor and carrier.
"""

import math
import sys

import numpy as np

from rf_pointing.core.pass_outcome import PassOutcome
from rf_pointing.ephemeris import Pass, first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.station.pointing.certificates import pass_profile

CASES = (
    "X,monopulse,40", "X,conscan,40", "S,conscan,40", "S,steptrack,40", "Ka,monopulse,40", "S,monopulse,88",
    "X,monopulse,88", "X,conscan,88",
)  # fmt: skip
LEAD_S = 150.0
"""Time before the pass for the slew to its start."""
CLUSTER_S = 0.1
FRESH = {f"uncertainty.{name}": 0.0 for name in (
    "along_growth_m_s", "along_drag_m_s2", "cross_growth_m_s", "radial_growth_m_s",
)}  # fmt: skip
"""The satellite is simulated where fresh elements say, up to twelve days after their epoch."""


def case(name: str, mask_deg: float = 5.0) -> tuple[StationSetup, Pass, str, float]:
    """Return station, pass, sensor and half-power beamwidth (rad) of a case."""
    band, sensor, peak = name.split(",")
    setup = StationSetup("dss13", band, changes={"ephemeris_publisher": FRESH})
    source = SourceParams(satellite="28057")
    epoch_t_s, peak_rad = load_elements(source).epoch_t_s, math.radians(float(peak))
    window = first_pass_above(setup.track(), epoch_t_s, peak_rad, math.radians(mask_deg), 12.0 * 86400.0)
    return setup, window, sensor, setup.controller().corrections.half_power_beamwidth_rad


def main() -> None:
    """Fly the cases of the command line, without one all of them."""
    plan = "--plan" in sys.argv[1:]
    print(
        f"{'case':18}{'peak, deg':>10}{'lost, s: predicted':>20}{'flown':>8}{'loss, dB: predicted':>21}{'flown':>8}{'off':>8}"
    )
    for name in [word for word in sys.argv[1:] if word != "--plan"] or CASES:
        setup, window, sensor, width_rad = case(name)
        start_s = math.floor(window.aos_t_s) - LEAD_S
        if plan:
            controller, antenna = setup.controller(), setup.antenna()
            controller.plan.take_profiles([pass_profile(setup.track(), window)])
            controller.take_joints(antenna.reading(start_s))
            controller.start(start_s, window, sensor)
            certificate, flown = controller.plan.certificate, PassOutcome()
        else:
            log = simulate_pass(setup, window, start_s, sensor)
            inside = (np.array(log.t_s) >= window.aos_t_s) & (np.array(log.t_s) <= window.los_t_s)
            certificate = log.certificate
            flown = PassOutcome.of(np.hypot(*log.errors_rad().T)[inside], width_rad, CLUSTER_S)
        chosen = certificate.chosen
        lost_s = chosen.lost_s + chosen.late_s + chosen.acquisition_s
        off = flown.mean_loss_db - chosen.mean_loss_db
        print(
            f"{name:18}{math.degrees(window.peak_elevation_rad):10.1f}{lost_s:20.1f}{flown.lost_s:8.1f}"
            f"{chosen.mean_loss_db:21.3f}{flown.mean_loss_db:8.3f}{off:8.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
