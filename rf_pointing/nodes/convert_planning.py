"""Messages from and to passes and the planner's nouns, as pairs, like `convert.py`."""

import numpy as np
from rf_pointing_msgs import msg as ours

from rf_pointing.core import require_finite
from rf_pointing.ephemeris import Pass
from rf_pointing.nodes.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.planning import Branch, Certificate, MachineParams, PassProfile

_PASS_TIMES = {"aos": "aos_t_s", "tca": "tca_t_s", "los": "los_t_s"}
_PASS_FIELDS = {
    "aos_azimuth": "aos_azimuth_rad",
    "los_azimuth": "los_azimuth_rad",
    "azimuth_min": "azimuth_min_rad",
    "azimuth_max": "azimuth_max_rad",
    "aos_elevation": "aos_elevation_rad",
    "peak_elevation": "peak_elevation_rad",
    "peak_azimuth_rate": "peak_azimuth_rate_rad_s",
    "peak_elevation_rate": "peak_elevation_rate_rad_s",
    "peak_azimuth_acceleration": "peak_azimuth_acceleration_rad_s2",
    "smallest_range": "smallest_range_m",
}
_PROFILE = {"": "position_rad", "_rate": "velocity_rad_s", "_acceleration": "acceleration_rad_s2"}
_PAIRS = {
    "start": "start_rad",
    "end": "end_rad",
    "azimuth_range": "azimuth_range_rad",
    "elevation_range": "elevation_range_rad",
    "peak_rate": "peak_rate_rad_s",
    "peak_acceleration": "peak_acceleration_rad_s2",
}
_NUMBERS = {
    "limit_margin": "limit_margin_rad",
    "mask_margin": "mask_margin_rad",
    "sun_margin": "sun_margin_rad",
    "keyhole": "keyhole_s",
    "lost": "lost_s",
    "lost_signal": "lost_signal_s",
    "peak_loss": "peak_loss_db",
    "mean_loss": "mean_loss_db",
    "preposition": "preposition_s",
    "unwind": "unwind_s",
    "late": "late_s",
}


def pass_to_message(window: Pass) -> ours.Pass:
    return ours.Pass(
        target=window.name,
        **{wire: stamp_from_seconds(getattr(window, core)) for wire, core in _PASS_TIMES.items()},
        **{wire: float(getattr(window, core)) for wire, core in _PASS_FIELDS.items()},
    )


def pass_from_message(message: ours.Pass) -> Pass:
    for wire in _PASS_FIELDS:
        require_finite(wire, getattr(message, wire))
    aos_s, tca_s, los_s = (seconds_from_stamp(getattr(message, wire)) for wire in _PASS_TIMES)
    if not aos_s <= tca_s <= los_s or aos_s == los_s:
        raise ValueError(f"aos={aos_s}, tca={tca_s} and los={los_s} must follow each other")
    return Pass(
        name=message.target,
        **{core: seconds_from_stamp(getattr(message, wire)) for wire, core in _PASS_TIMES.items()},
        **{core: getattr(message, wire) for wire, core in _PASS_FIELDS.items()},
        rises_before=False,
        sets_after=False,
    )


def profile_to_message(profile: PassProfile) -> ours.PassProfile:
    start_s = float(profile.t_s[0])
    message = ours.PassProfile(target=profile.name, aos=stamp_from_seconds(start_s))
    message.time = (profile.t_s - start_s).tolist()
    for ending, name in _PROFILE.items():
        values = getattr(profile, name)
        setattr(message, f"azimuth{ending}", values[:, 0].tolist())
        setattr(message, f"elevation{ending}", values[:, 1].tolist())
    message.sun_azimuth, message.sun_elevation = (part.tolist() for part in profile.sun_rad.T)
    return message


def profile_from_message(message: ours.PassProfile) -> PassProfile:
    count = len(message.time)
    for axis in ("azimuth", "elevation"):
        for name in (axis, f"{axis}_rate", f"{axis}_acceleration", f"sun_{axis}"):
            if len(getattr(message, name)) != count:
                raise ValueError(f"{name} has {len(getattr(message, name))} values, must have {count}")
    pairs = {
        name: np.column_stack([getattr(message, f"azimuth{ending}"), getattr(message, f"elevation{ending}")])
        for ending, name in _PROFILE.items()
    }
    return PassProfile(
        name=message.target,
        t_s=seconds_from_stamp(message.aos) + np.array(message.time),
        sun_rad=np.column_stack([message.sun_azimuth, message.sun_elevation]),
        **pairs,
    )


def certificate_to_message(certificate: Certificate) -> ours.PassCertificate:
    message = ours.PassCertificate(
        target=certificate.name,
        aos=stamp_from_seconds(certificate.aos_t_s),
        los=stamp_from_seconds(certificate.los_t_s),
        accepted=certificate.chosen is not None,
        refusal=certificate.reason,
        sky_peak=certificate.sky_peak_rad,
        branches=[_branch_to_message(branch) for branch in certificate.branches],
    )
    message.rate_limit = certificate.machine.rate_limit_rad_s
    message.acceleration_limit = certificate.machine.acceleration_limit_rad_s2
    message.header.stamp = stamp_from_seconds(certificate.issued_t_s)
    return message


def certificate_from_message(message: ours.PassCertificate) -> Certificate:
    """Return the certificate without its crossings, which do not travel."""
    return Certificate(
        name=message.target,
        issued_t_s=seconds_from_stamp(message.header.stamp),
        aos_t_s=seconds_from_stamp(message.aos),
        los_t_s=seconds_from_stamp(message.los),
        sky_peak_rad=message.sky_peak,
        branches=tuple(_branch_from_message(branch) for branch in message.branches),
        machine=MachineParams(
            rate_limit_rad_s=tuple(message.rate_limit.tolist()),
            acceleration_limit_rad_s2=tuple(message.acceleration_limit.tolist()),
        ),
    )


def _branch_to_message(branch: Branch) -> ours.PassBranch:
    message = ours.PassBranch(
        turns=branch.turns,
        plunge=branch.plunge,
        over=branch.over,
        works=branch.works,
        refusals=list(branch.reasons),
        closest_limit=branch.closest_limit,
        **{wire: float(getattr(branch, core)) for wire, core in _NUMBERS.items()},
    )
    for wire, core in _PAIRS.items():
        setattr(message, wire, getattr(branch, core))
    return message


def _branch_from_message(message: ours.PassBranch) -> Branch:
    return Branch(
        turns=message.turns,
        plunge=message.plunge,
        over=message.over,
        reasons=tuple(message.refusals),
        closest_limit=message.closest_limit,
        **{core: tuple(getattr(message, wire).tolist()) for wire, core in _PAIRS.items()},
        **{core: getattr(message, wire) for wire, core in _NUMBERS.items()},
    )
