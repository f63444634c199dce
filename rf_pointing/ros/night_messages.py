"""Messages that an executive receives from antenna and partners, and those about its night."""

import time
from collections.abc import Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState

from rf_pointing.operations.night import Night
from rf_pointing.operations.schedule import Entry
from rf_pointing.ros import convert
from rf_pointing.ros.command_key import CALL_S, CommandKey
from rf_pointing.ros.convert_planning import entry_to_message
from rf_pointing.ros.directives import plain_fields
from rf_pointing.ros.graph import EXECUTIVE_STATUS, SCHEDULE
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import LATCHED, STATUS, WATCHED
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.clients.night_watch import NightWatch

MOVING_RAD_S = 1e-4


def hear(node: ManagedNode, watch: NightWatch) -> None:
    """Subscribe until cleanup to what a watch must know."""
    night, stamp = watch.night, seconds_from_stamp
    mine = node.get_namespace().rstrip("/") + "/"
    joints = node.listen_latest(JointState, "joint_states", convert.joints_from_message, WATCHED)

    def take(device: str, message: Any, **more: Any) -> None:
        night.take(device, plain_fields(message) | more, stamp(message.header.stamp))

    def on_antenna(message: ours.AntennaStatus) -> None:
        take("antenna", message, moving=max(map(abs, message.rate_command)) > MOVING_RAD_S)
        if (reading := joints.take()) is not None:
            azimuth, elevation = map(float, reading.position_rad)
            night.take("antenna", {"azimuth": azimuth, "elevation": elevation}, reading.t_s)

    def on_passes(message: ours.PassList) -> None:
        windows = [(stamp(each.aos), stamp(each.los), each) for each in message.passes]
        night.take_passes(message.target, windows, node.now_s())

    def on_target(message: ours.Target) -> None:
        # Without elements there is no covariance, and an age means nothing.
        if message.covariance:
            values = {"age_h": message.element_age / 3600.0, "target": message.target}
            night.take("elements", values, stamp(message.header.stamp))

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            name, level = status.hardware_id, int.from_bytes(status.level, "little")
            if name.startswith(mine) and name != node.get_fully_qualified_name():
                check, values = status.name.partition(": ")[2], {pair.key: pair.value for pair in status.values}
                watch.take_check(name.removeprefix(mine), check, level, status.message, values, time.monotonic())

    node.listen(ours.AntennaStatus, "antenna_status", on_antenna, WATCHED)
    node.listen(ours.TrackingStatus, "tracking_status", lambda m: take("tracking", m), WATCHED)
    node.listen(ours.PassList, "passes", on_passes, LATCHED)
    node.listen(ours.Target, "target", on_target, WATCHED)
    # Latched: it is of now when it arrives.
    certificate = lambda m: night.take("certificate", plain_fields(m), node.now_s())  # noqa: E731
    node.listen(ours.PassCertificate, "pass_certificate", certificate, LATCHED)
    node.listen(DiagnosticArray, "/diagnostics", on_diagnostics, WATCHED)


def hear_partner(node: ManagedNode, watch: NightWatch, key: CommandKey, name: str) -> None:
    """Subscribe until cleanup to what a partner claims: signed, not ahead, and not of before."""
    newest_s: dict[str, float] = {}

    def check(message: Any, topic: str) -> float:
        key.check_claim(message, topic, name, node.now_s())
        stamp_s = seconds_from_stamp(message.header.stamp)
        if stamp_s < newest_s.get(topic, 0.0):
            raise ValueError("an older one than that of before")
        newest_s[topic] = stamp_s
        return stamp_s

    def on_schedule(message: ours.Schedule) -> None:
        check(message, SCHEDULE)
        watch.take_partner(name, {each.id: each.state for each in message.passes}, time.monotonic())

    def on_status(message: ours.ExecutiveStatus) -> None:
        if (age_s := node.now_s() - check(message, EXECUTIVE_STATUS)) > CALL_S:
            raise ValueError(f"it is {age_s:.1f} s old, must be <= {CALL_S:.0f} s")
        watch.take_partner(name, None, time.monotonic())

    node.listen(ours.Schedule, f"/{name}/{SCHEDULE}", on_schedule, LATCHED)
    node.listen(ours.ExecutiveStatus, f"/{name}/{EXECUTIVE_STATUS}", on_status, STATUS)


def schedule_to_message(entries: Iterable[Entry], t_s: float) -> ours.Schedule:
    message = ours.Schedule(passes=[entry_to_message(each) for each in entries])
    message.header.stamp = stamp_from_seconds(t_s)
    return message


def executive_status_to_message(night: Night, t_s: float) -> ours.ExecutiveStatus:
    entry, following = night.schedule.active, night.schedule.next()
    message = ours.ExecutiveStatus(
        state=str(night.state_name), pass_id=night.active_id, target=entry.item.name if entry else "",
        blocks=night.blocks(), reason=night.reason, next_id=following.item.id if following else "",
    )  # fmt: skip
    message.header.stamp = stamp_from_seconds(t_s)
    if following is not None:
        message.next_start = stamp_from_seconds(following.item.aos_t_s)
    message.alarms = [
        ours.Alarm(
            name=each.name, level=each.level, message=each.message, raised=stamp_from_seconds(each.raised_t_s),
            acknowledged=each.acknowledged, count=each.count,
        )
        for each in night.book.lasting
    ]  # fmt: skip
    return message
