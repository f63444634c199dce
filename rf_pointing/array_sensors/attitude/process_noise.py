"""Process noise of attitude motion, shared by the simulated satellite and the filters.

DOA adds Q = q E_6 at every 250-ms step, to the rate (rad/s)^2 and to the vector part of the quaternion.  A rotation is
twice the vector part, so per second that is 4 q / dt on the attitude and q / dt on the rate.  The printed q = 1e-9
makes the filter itself predict degrees; q = 1e-12 gives the paper's tables in kind.
"""

from dataclasses import dataclass

from rf_pointing.core import Params, parameter, require_between

__all__ = ["PRINTED_Q", "TABLE_Q", "ProcessNoiseParams", "process_noise_from_q"]

PRINTED_Q = 1e-9
TABLE_Q = 1e-12


@dataclass(frozen=True, kw_only=True)
class ProcessNoiseParams(Params):
    """Random walk added per second to the attitude and to the rate, each axis."""

    attitude_rad2_s: float = parameter(1.6e-11, "variance of the attitude per second, rad^2/s", low=0.0, high=1.0)
    rate_rad2_s3: float = parameter(4e-12, "variance of the rate per second, rad^2/s^3", low=0.0, high=1.0)


def process_noise_from_q(q: float, dt_s: float = 0.25) -> ProcessNoiseParams:
    """Return the noise equal to DOA's Q = q E_6 added every `dt_s`."""
    require_between("q", q, 0.0, 1e-3)
    require_between("dt_s", dt_s, 1e-6, 10.0)
    return ProcessNoiseParams(attitude_rad2_s=4.0 * q / dt_s, rate_rad2_s3=q / dt_s)
