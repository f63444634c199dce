"""Messages from and to passes, goals and the planner's nouns, as pairs, like `convert.py`."""

import math
from collections.abc import Sequence

import numpy as np
from rf_pointing_msgs import msg as ours
from rf_pointing_msgs.action import Scan, TrackPass

from rf_pointing.core import LEVEL, Kinematics, require_finite
from rf_pointing.ephemeris import Pass, SunPermit
from rf_pointing.operations.schedule import MOST_PASSES, Entry, ScheduledPass, require_each_once
from rf_pointing.planning import Branch, Certificate, MachineParams, PassProfile
from rf_pointing.ros.convert import pair
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.streams import require_plausible
from rf_pointing.station.clients.goals import PassGoal
from rf_pointing.tracking.scan_program import ScanProgramParams

_PROFILE = {"": "position_rad", "_rate": "velocity_rad_s", "_acceleration": "acceleration_rad_s2"}

pass_to_message, _pass_from_message = pair(Pass, ours.Pass, name="target", rises_before=None, sets_after=None)
_scheduled_to_message, _scheduled_from_message = pair(
    ScheduledPass, ours.ScheduledPass, peak_rad="peak_elevation", azimuth_path_rad=None,
    elevation_rad=None, element_age_s=None,
)  # fmt: skip
_certificate_to_message, _certificate_from_message = pair(
    Certificate, ours.PassCertificate, name="target", issued_t_s=None, branches=None, machine=None, mount=None
)
_branch_to_message, _branch_from_message = pair(
    Branch, ours.PassBranch, reasons="refusals", crossing=None, axes_rad=None
)
_, _goal_from_message = pair(PassGoal, TrackPass.Goal, window=None, scan=None)
scan_to_message, _scan_from_message = pair(ScanProgramParams, Scan.Goal, baseline_s="baseline_time")


def scheduled_to_message(item: ScheduledPass) -> ours.ScheduledPass:
    begin, end = item.elevation_rad
    return _scheduled_to_message(
        item, azimuth_path=list(item.azimuth_path_rad or ()), aos_elevation=begin, los_elevation=end,
        element_age=0.0 if math.isnan(item.element_age_s) else item.element_age_s,
    )  # fmt: skip


def scheduled_from_messages(messages: Sequence[ours.ScheduledPass]) -> list[ScheduledPass]:
    """Return the passes of a request; ValueError names what cannot be one."""
    if len(messages) > MOST_PASSES:
        raise ValueError(f"a schedule of {len(messages)} passes must have <= {MOST_PASSES}")
    found = []
    for number, each in enumerate(messages, start=1):
        try:
            require_plausible(each)
            path = tuple(each.azimuth_path)
            if len(path) not in (0, 4):
                raise ValueError(f"azimuth_path has {len(path)} angles, must have 4 or none")
            found.append(_scheduled_from_message(
                each, azimuth_path_rad=path or None, elevation_rad=(each.aos_elevation, each.los_elevation),
                element_age_s=each.element_age or math.nan,
            ))  # fmt: skip
        except ValueError as error:
            raise ValueError(f"pass {number}: {error}") from error
    require_each_once(found)
    return found


def sun_permit_from_message(message: ours.AntennaStatus) -> SunPermit | None:
    """Return who lets the beam of which band look into the Sun until when."""
    until_t_s = seconds_from_stamp(message.sun_permit_until)
    if not message.sun_permit:
        return None
    return SunPermit(by=message.sun_permit, band=message.sun_permit_band, until_t_s=until_t_s)


def entry_to_message(entry: Entry) -> ours.ScheduledPass:
    message = scheduled_to_message(entry.item)
    message.state, message.reason, message.mean_loss = str(entry.state), entry.reason, entry.loss_db
    message.seconds_tracked, message.seconds_lost = entry.tracked_s, entry.lost_s
    return message


def pass_from_message(message: ours.Pass) -> Pass:
    for wire, kind in message.get_fields_and_field_types().items():
        if kind == "double":
            require_finite(wire, getattr(message, wire))
    window = _pass_from_message(message, rises_before=False, sets_after=False)
    if not window.aos_t_s <= window.tca_t_s <= window.los_t_s or window.aos_t_s == window.los_t_s:
        raise ValueError(f"aos={window.aos_t_s}, tca={window.tca_t_s} and los={window.los_t_s} must follow each other")
    return window


def profile_to_message(profile: PassProfile) -> ours.PassProfile:
    start_s = float(profile.t_s[0])
    message = ours.PassProfile(target=profile.name, aos=stamp_from_seconds(start_s))
    message.time = (profile.t_s - start_s).tolist()
    for ending, name in _PROFILE.items():
        values = getattr(profile, name)
        setattr(message, f"azimuth{ending}", values[:, 0].tolist())
        setattr(message, f"elevation{ending}", values[:, 1].tolist())
    message.sun_azimuth, message.sun_elevation = (part.tolist() for part in profile.sun_rad.T)
    message.range, message.satellite_gain = profile.range_m.tolist(), profile.satellite_gain_db.tolist()
    message.along_sigma, message.cross_sigma = profile.along_sigma_s, profile.cross_sigma_m
    return message


def profile_from_message(message: ours.PassProfile) -> PassProfile:
    count = len(message.time)
    of_axes = [f"{axis}{ending}" for axis in ("azimuth", "elevation") for ending in _PROFILE]
    for name in (*of_axes, "sun_azimuth", "sun_elevation", "range", "satellite_gain"):
        if len(getattr(message, name)) != count:
            raise ValueError(f"{name} has {len(getattr(message, name))} values, must have {count}")
    pairs = {
        name: np.column_stack([getattr(message, f"azimuth{ending}"), getattr(message, f"elevation{ending}")])
        for ending, name in _PROFILE.items()
    }
    return PassProfile(
        name=message.target, t_s=seconds_from_stamp(message.aos) + np.array(message.time),
        sun_rad=np.column_stack([message.sun_azimuth, message.sun_elevation]),
        range_m=np.array(message.range), satellite_gain_db=np.array(message.satellite_gain),
        along_sigma_s=message.along_sigma, cross_sigma_m=message.cross_sigma, **pairs,
    )  # fmt: skip


def certificate_to_message(certificate: Certificate) -> ours.PassCertificate:
    message = _certificate_to_message(certificate, accepted=certificate.chosen is not None, refusal=certificate.reason)
    message.branches = [_branch_to_message(branch, works=branch.works) for branch in certificate.branches]
    message.rate_limit = certificate.machine.rate_limit_rad_s
    message.acceleration_limit = certificate.machine.acceleration_limit_rad_s2
    message.least_share = certificate.machine.least_share
    message.header.stamp = stamp_from_seconds(certificate.issued_t_s)
    return message


def certificate_from_message(message: ours.PassCertificate, mount: Kinematics = LEVEL) -> Certificate:
    """Return the certificate of a `mount` without its crossings, which do not travel."""
    if not message.branches:
        raise ValueError("a certificate has no branch, must have >= 1")
    return _certificate_from_message(
        message,
        issued_t_s=seconds_from_stamp(message.header.stamp),
        mount=mount,
        branches=tuple(_branch_from_message(branch) for branch in message.branches),
        machine=MachineParams(
            rate_limit_rad_s=tuple(message.rate_limit.tolist()),
            acceleration_limit_rad_s2=tuple(message.acceleration_limit.tolist()),
            least_share=message.least_share,
        ),
    )


def goal_of_scan(message: Scan.Goal) -> PassGoal:
    if not message.satellite:
        raise ValueError("satellite='' must name what is scanned")
    return PassGoal(
        satellite=message.satellite, near_t_s=seconds_from_stamp(message.near),
        minimum_peak_elevation_rad=message.minimum_peak_elevation, scan=_scan_from_message(message),
    )  # fmt: skip


def goal_from_message(message: TrackPass.Goal) -> PassGoal:
    if message.satellite and message.target_pass.target:
        raise ValueError(
            f"satellite={message.satellite!r} and a target_pass of {message.target_pass.target!r}: give one of them"
        )
    return _goal_from_message(message, window=None if message.satellite else pass_from_message(message.target_pass))
