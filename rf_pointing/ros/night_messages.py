"""Messages that an executive receives from antenna and partners, and those about night and alarms.

`hear_station` and `serve_alarms` are what it shares with the node of a station without a night.
"""

import time
from collections.abc import Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing.core.dates import parse_utc
from rf_pointing.operations.alarms import ERROR
from rf_pointing.operations.night import NightState
from rf_pointing.operations.schedule import Entry
from rf_pointing.ros import convert
from rf_pointing.ros.command_key import CALL_S, INSTANCE, CommandKey, CommandKeyParams
from rf_pointing.ros.convert_planning import entry_to_message
from rf_pointing.ros.diagnostics import LEVELS
from rf_pointing.ros.directives import plain_fields
from rf_pointing.ros.graph import ALARM_TOPIC, EXECUTIVE_STATUS, SCHEDULE
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import LATCHED, STATUS, WATCHED
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.clients.alarm_hooks import LEVEL_NAMES, Message
from rf_pointing.station.clients.night_watch import ExecutiveParams, NightWatch
from rf_pointing.station.clients.station_alarms import StationAlarms

MOVING_RAD_S = 1e-4
LOST_EXECUTIVE = "lost_executive"
"""Alarm of station_alarms while an executive is silent."""


def hear_station(node: ManagedNode, alarms: StationAlarms) -> None:
    """Subscribe until cleanup to what the alarms of a station must know."""
    mine = node.get_namespace().rstrip("/") + "/"
    read = convert.joints_from_message
    joints = node.listen_latest(JointState, "joint_states", read, WATCHED, required=True)

    def take(device: str, message: Any, **more: Any) -> None:
        alarms.take(device, plain_fields(message) | more, seconds_from_stamp(message.header.stamp))

    def on_antenna(message: ours.AntennaStatus) -> None:
        moving = max(map(abs, message.rate_command)) > MOVING_RAD_S
        until_t_s = seconds_from_stamp(message.sun_permit_until)
        take("antenna", message, moving=moving, sun_permit_until_t_s=until_t_s)
        if (reading := joints.take()) is not None:
            alarms.take_place(tuple(reading.position_rad.tolist()), reading.t_s)

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            name, level = status.hardware_id, int.from_bytes(status.level, "little")
            if name.startswith(mine) and name != node.get_fully_qualified_name():
                check, values = status.name.partition(": ")[2], {pair.key: pair.value for pair in status.values}
                alarms.take_check(name.removeprefix(mine), check, level, status.message, values, time.monotonic())

    node.listen(ours.AntennaStatus, "antenna_status", on_antenna, WATCHED, required=True)
    node.listen(ours.TrackingStatus, "tracking_status", lambda m: take("tracking", m), WATCHED, required=True)
    node.listen(DiagnosticArray, "/diagnostics", on_diagnostics, WATCHED)


def hear_night(node: ManagedNode, watch: NightWatch, own: ExecutiveParams) -> CommandKey:
    """Subscribe until cleanup to what a night must know; return the key shared with partners."""
    night, stamp = watch.night, seconds_from_stamp

    def on_passes(message: ours.PassList) -> None:
        windows = [(stamp(each.aos), stamp(each.los), each) for each in message.passes]
        night.take_passes(message.target, windows, node.now_s())

    hear_station(node, watch.alarms)
    node.listen(ours.PassList, "passes", on_passes, LATCHED)
    # Latched: it is of now when it arrives.
    certificate = lambda m: night.take("certificate", plain_fields(m), node.now_s())  # noqa: E731
    node.listen(ours.PassCertificate, "pass_certificate", certificate, LATCHED)
    params = CommandKeyParams(command_key_file=own.partners_key_file if own.partners else "")
    key = CommandKey(params, parameter="executive.partners_key_file")
    for name in watch.partners:
        hear_partner(node, watch, key, name)
    hear_rival(node, watch, key)
    return key


def hear_rival(node: ManagedNode, watch: NightWatch, key: CommandKey) -> None:
    """Subscribe until cleanup to another executive of this antenna, on another computer."""

    def on_status(message: ours.ExecutiveStatus) -> None:
        who = message.process
        if who != INSTANCE:
            if key.signed:
                key.check_claim(message, EXECUTIVE_STATUS, node.get_namespace().strip("/"), node.now_s())
            night = message.state not in (NightState.IDLE, NightState.ENDED)
            watch.take_rival(who, night=night, first=who < INSTANCE, wall_s=time.monotonic())

    node.listen(ours.ExecutiveStatus, EXECUTIVE_STATUS, on_status, STATUS)


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
        watch.others.take(name, time.monotonic(), watch.night, states={each.id: each.state for each in message.passes})

    def on_status(message: ours.ExecutiveStatus) -> None:
        if (age_s := node.now_s() - check(message, EXECUTIVE_STATUS)) > CALL_S:
            raise ValueError(f"it is {age_s:.1f} s old, must be <= {CALL_S:.0f} s")
        ended = message.state == NightState.ENDED
        runs = not ended and message.state != NightState.IDLE
        sends = "" if message.partner_inhibit else message.pass_id
        watch.others.take(name, time.monotonic(), watch.night, night=runs, ended=ended, sends=sends)

    node.listen(ours.Schedule, f"/{name}/{SCHEDULE}", on_schedule, LATCHED)
    node.listen(ours.ExecutiveStatus, f"/{name}/{EXECUTIVE_STATUS}", on_status, STATUS)


def serve_alarms(node: ManagedNode, alarms: StationAlarms) -> None:
    """Show the alarms and the ways out of the station on /diagnostics, and try these on request."""
    node.diagnostics.add_report("alarms", alarms.report)
    node.diagnostics.add_report("hooks", alarms.hooks.report)
    node.diagnostics.add_report("computer", alarms.computer)
    node.serve_action(Trigger, "~/test_alarms", lambda _: alarms.test(node.now_s()))


def hear_outages(node: ManagedNode, watch: NightWatch) -> None:
    """Note when this executive itself was lost, as station_alarms has reported it meanwhile."""

    def take(message: DiagnosticArray) -> None:
        for status in message.status:
            values = {each.key: each.value for each in status.values}
            if status.name == LOST_EXECUTIVE and (event := values.get("event")) in ("raised", "cleared"):
                t_s = parse_utc(values.get("utc", ""))
                watch.night.book.note_of_another(t_s, event, LOST_EXECUTIVE, ERROR, status.message)

    node.listen(DiagnosticArray, ALARM_TOPIC, take, STATUS)


class AlarmTopic:
    """Publishes each message of an alarm on `alarms`, and logs it."""

    def __init__(self, node: ManagedNode) -> None:
        self._node, self._publisher = node, node.publisher(DiagnosticArray, ALARM_TOPIC, STATUS)

    def publish(self, message: Message) -> None:
        """Publish and log one message."""
        good = message["level"] == "ok" or message["event"] == "cleared"
        level = LEVELS[LEVEL_NAMES.index(message["level"])]
        values = [KeyValue(key=key, value=message[key]) for key in ("event", "to_do", "utc")]
        status = DiagnosticStatus(
            level=LEVELS[0] if good else level, name=message["alarm"], message=message["message"],
            hardware_id=message["station"], values=values,
        )  # fmt: skip
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
        words = f"alarm {message['event']}: {message['alarm']}: {message['message']}"
        log(self._node, words if good else f"{words}; {message['to_do']}", good=good)


def log(node: ManagedNode, text: str, *, good: bool) -> None:
    """Log and show at once what an operator should see."""
    # Two lines: one line of code that logs at two levels raises.
    if good:
        node.get_logger().info(text)
    else:
        node.get_logger().warning(text)
    node.diagnostics.publish()


def schedule_to_message(entries: Iterable[Entry], t_s: float) -> ours.Schedule:
    message = ours.Schedule(passes=[entry_to_message(each) for each in entries])
    message.header.stamp = stamp_from_seconds(t_s)
    return message


def executive_status_to_message(watch: NightWatch, t_s: float, *, ended: bool = False) -> ours.ExecutiveStatus:
    night = watch.night
    entry, following = night.schedule.active, night.schedule.next()
    message = ours.ExecutiveStatus(
        state=str(NightState.ENDED if ended else night.state_name), shares=bool(watch.partners),
        partner_inhibit=watch.inhibit(time.monotonic()),
        pass_id=night.active_id, target=entry.item.name if entry else "",
        blocks=[
            ours.ProcedureBlock(name=name, state=str(run.state), reason=run.reason) for name, run in night.blocks()
        ],
        reason=night.reason, next_id=following.item.id if following else "",
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
