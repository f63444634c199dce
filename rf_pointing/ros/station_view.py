"""Published values of a station as plain numbers: angles in degrees, times in UTC.

The client `station` prints these values and the operator's page shows them.
"""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

from rf_pointing_msgs import msg as ours

from rf_pointing import planning
from rf_pointing.core.dates import utc_text
from rf_pointing.operations.executor import block_text
from rf_pointing.ros import convert_planning
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.station.clients.board import MOST_ROWS, degrees


def stamp_text(stamp: Any) -> str:
    """Return a stamp as UTC text."""
    return utc_text(seconds_from_stamp(stamp))


def status_values(
    antenna: ours.AntennaStatus, tracking: ours.TrackingStatus, executive: ours.ExecutiveStatus
) -> dict[str, Any]:
    """Return what the station does."""
    azimuth, elevation = map(math.degrees, antenna.commanded)
    return {
        "utc": stamp_text(antenna.header.stamp), "antenna": antenna.mode, "fault": antenna.fault, "warning": antenna.warning,
        "sun_permitted": sun_permitted(antenna),
        "azimuth_deg": round(azimuth, 3), "elevation_deg": round(elevation, 3), "tracking": tracking.mode,
        "target": tracking.target, "on_source": tracking.on_source, "carrier_to_noise_db_hz": tracking.carrier_to_noise,
        "seconds_tracked": tracking.seconds_tracked, "executive": executive.state, "pass": executive.pass_id,
        "pass_target": executive.target,
        "next": executive.next_id, "doing": executive.reason, "blocks": blocks_values(executive),
        "alarms": [alarm_values(each) for each in executive.alarms],
    }  # fmt: skip


def sun_permitted(antenna: ours.AntennaStatus) -> str:
    """Return who lets the beam look into the Sun until when, "" for nobody."""
    permit = convert_planning.sun_permit_from_message(antenna)
    return permit.text if permit else ""


def blocks_values(executive: ours.ExecutiveStatus) -> list[str]:
    """Return what an operator reads of the blocks that last."""
    return [block_text(each.name, each.state, each.reason) for each in executive.blocks]


def alarm_values(alarm: ours.Alarm) -> dict[str, Any]:
    """Return an alarm that lasts."""
    return {name: getattr(alarm, name) for name in ("name", "level", "message", "acknowledged")}


def words_of(*messages: Any) -> dict[str, str | bool]:
    """Return the texts and truth values of messages, by the names of their fields."""
    fields = ((message, name) for message in messages for name in message.get_fields_and_field_types())
    return {name: value for message, name in fields if isinstance(value := getattr(message, name), str | bool)}


def entry_values(entry: ours.ScheduledPass) -> dict[str, Any]:
    """Return one pass of the schedule."""
    return {
        "id": entry.id, "target": entry.name or entry.target, "priority": entry.priority, "aos_utc": stamp_text(entry.aos),
        "los_utc": stamp_text(entry.los), "peak_deg": round(math.degrees(entry.peak_elevation), 2), "state": entry.state,
        "reason": entry.reason, "seconds_tracked": entry.seconds_tracked, "seconds_lost": entry.seconds_lost,
    }  # fmt: skip


def window_values(window: ours.Pass) -> dict[str, Any]:
    """Return one coming pass of the selected target."""
    return {"target": window.target, "aos_utc": stamp_text(window.aos), "los_utc": stamp_text(window.los),
            "peak_deg": round(math.degrees(window.peak_elevation), 2)}  # fmt: skip


def moving_values(antenna: ours.AntennaStatus, tracking: ours.TrackingStatus) -> dict[str, Any]:
    """Return what changes all the time: words, rates, limits, the beam and the error in it.

    The error is in beamwidths, cross-elevation and elevation, [] where no beamwidth is published.
    """
    error = (tracking.cross_elevation_error, tracking.elevation_error)
    beam = tracking.beamwidth
    return {
        **words_of(antenna, tracking), "t_s": seconds_from_stamp(antenna.header.stamp),
        "rate_deg_s": degrees(antenna.rate_command), "rate_limit_deg_s": degrees(antenna.rate_limit),
        "at_limit": [bool(each) for each in antenna.at_limit], "level": tracking.level,
        "beam_deg": degrees((tracking.azimuth, tracking.elevation)), "beamwidth_deg": round(math.degrees(beam), 5),
        "error_beamwidths": [round(float(each) / beam, 4) for each in error] if beam > 0.0 else [],
        "axis_distance_deg": round(math.degrees(tracking.axis_distance), 5),
        "seconds_lost": round(tracking.seconds_lost, 1), "mean_loss_db": round(tracking.mean_loss, 2),
        "los_s": seconds_from_stamp(tracking.los),
    }  # fmt: skip


def target_values(target: ours.Target) -> dict[str, Any]:
    """Return where the target is; its stamp is ahead of the present."""
    return {
        "name": target.target, "position_deg": degrees((target.azimuth, target.elevation), 3),
        "range_km": round(target.range / 1e3, 1), "range_rate_m_s": round(target.range_rate, 1),
        "age_h": round(target.element_age / 3600.0, 1) if target.covariance else None,
        "along_sigma_s": round(target.along_track_time_sigma, 3) if target.covariance else None,
    }  # fmt: skip


def live_values(newest: Mapping[str, Any]) -> dict[str, Any]:
    """Return what moves: of `antenna`, `tracking`, `executive`, `target`, `joints`, `schedule`."""
    values: dict[str, Any] = {}
    if "antenna" in newest:
        tracking = newest.get("tracking", ours.TrackingStatus())
        executive = newest.get("executive", ours.ExecutiveStatus(state="none"))
        values |= status_values(newest["antenna"], tracking, executive) | moving_values(newest["antenna"], tracking)
        # They are in the values of the executive.
        del values["alarms"], values["blocks"]
    if "joints" in newest:
        values["encoder_deg"] = degrees(newest["joints"].position_rad)
    if "target" in newest:
        values["sky_target"] = target_values(newest["target"])
    if "schedule" in newest:
        # All passes count; the page shows those around the next one alone.
        values["schedule_states"] = dict(Counter(each.state for each in newest["schedule"].passes))
    return values


def executive_values(executive: ours.ExecutiveStatus) -> dict[str, Any]:
    """Return the executive with its alarms."""
    return {
        "state": executive.state, "pass": executive.pass_id, "target": executive.target, "blocks": blocks_values(executive),
        "doing": executive.reason, "next": executive.next_id, "next_s": seconds_from_stamp(executive.next_start),
        "alarms": [
            {**alarm_values(each), "raised_utc": stamp_text(each.raised), "count": each.count}
            for each in executive.alarms
        ],
    }  # fmt: skip


def passes_values(message: ours.PassList) -> dict[str, Any]:
    """Return the coming passes of the selected target."""
    return {"target": message.target, "rows": [window_values(each) for each in message.passes[:MOST_ROWS]]}


def schedule_values(schedule: ours.Schedule) -> list[dict[str, Any]]:
    """Return the passes of a schedule; of a longer one those around the first that is not over."""
    rows = schedule.passes
    coming = (n for n, each in enumerate(rows) if each.state in ("waiting", "active"))
    first = max(0, min(next(coming, len(rows)) - MOST_ROWS // 4, len(rows) - MOST_ROWS))
    return [entry_values(each) for each in rows[first : first + MOST_ROWS]]


def certificate_values(message: ours.PassCertificate) -> dict[str, Any]:
    """Return the certificate in the words of its file, with the chosen branch alone."""
    certificate = convert_planning.certificate_from_message(message)
    values = planning.certificate_values(certificate)
    chosen = next((each for each in values.pop("branches") if each["chosen"]), None)
    return {**values, "label": certificate.chosen.label if certificate.chosen else "", "chosen": chosen}


def pass_line(row: dict[str, Any]) -> str:
    """Return one pass in a line, with its state where it is one of the schedule."""
    more = f"  {row['priority']:>4} {row['state']:<8} {row['id']}: {row['reason']}" if "id" in row else ""
    return f"{row['aos_utc'][:19]} {row['los_utc'][11:19]} {row['peak_deg']:6.2f} deg  {row['target']:<24}{more}"


def status_text(values: dict[str, Any]) -> str:
    """Return what the station does in a line, with a line for the fault and each alarm."""
    name = values["pass_target"] or values["pass"]
    parts = " ".join(filter(None, [name, "; ".join(values["blocks"])])), values["doing"]
    doing = "; ".join(filter(None, parts)) or "nothing"
    first, second = (each.replace("_", " ") for each in values.get("axes", ("az", "el")))
    axes = f"{first} {values['azimuth_deg']:.2f} {second} {values['elevation_deg']:.2f} deg"
    lines = [
        f"{values['utc'][:19]}  antenna {values['antenna']} {axes}"
        f"  {values['tracking'] or 'no controller'} {values['target']}  executive {values['executive']}: {doing}"
    ]
    named = ("fault", "warning", "sun_permitted", "learned")
    lines += [f"  {name.replace('_', ' ')}: {values[name]}" for name in named if values.get(name)]
    lines += [
        f"  {('', 'warning', 'ERROR')[each['level']]} {each['name']}: {each['message']}"
        + (" (acknowledged)" if each["acknowledged"] else "")
        for each in values["alarms"]
    ]
    return "\n".join(lines)
