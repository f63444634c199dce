"""Faults of commands, sensors, drive, clock and process on one live antenna_servo; each test mends what it broke.

They run on the simulated drive, where time follows the servo tick by tick, so that what is measured is what its own
control loop saw on any machine; and in real time on the real rotctld, but for these: faults that are injected into
encoders, tachometers and drives, which a real device does not take (`test/station/antenna/test_drive_antenna.py` has
them on devices that can be broken), and the file of parameters and the wrap file, which are read before any drive.
"""

import math
import os
import re
import signal
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import CommandSignature
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.ros.command_key import CommandKey, CommandKeyParams, digest_of
from rf_pointing.ros.diagnostics import ERROR, WARN
from rf_pointing.ros.graph import COMMANDS, SIGNATURES
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.qos import SERVICE, STREAM
from test.conftest import within
from test.drives.rotctld import RealRotctld
from test.faults.live_servo import RATE_RAD_S, START_RAD, WITH_HILL, Servo, on_rotctld, servo_yaml
from test.graph.conftest import live_graph

pytestmark = pytest.mark.graph

TICK_S = 0.02
ROUNDING_S = 1e-3


@pytest.fixture(scope="module")
def on_simulated(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[Servo]:
    folder = tmp_path_factory.mktemp("servo")
    with live_graph(folder, ros_domain) as live:
        yield Servo(live, servo_yaml(folder / "wrap.json"), WITH_HILL, key=str(folder / "command.key"))


@pytest.fixture(scope="module")
def on_wall_time(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[Servo]:
    """Simulated time waits for a node that stalls: only in wall time does a stall do anything."""
    folder = tmp_path_factory.mktemp("wall")
    with live_graph(folder, ros_domain) as live:
        key = str(folder / "command.key")
        yield Servo(live, servo_yaml(folder / "wrap.json"), WITH_HILL, key=key, wall=True)


@pytest.fixture(scope="module")
def on_hamlib(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[Servo]:
    server = RealRotctld()
    server.go(*(math.degrees(angle) for angle in START_RAD))
    while server.position() != pytest.approx(tuple(math.degrees(angle) for angle in START_RAD), abs=0.02):
        time.sleep(0.2)
    with live_graph(tmp_path_factory.mktemp("rotctld"), ros_domain) as live:
        yield Servo(live, "", on_rotctld(server.port), simulated=False)
    server.kill()


@pytest.fixture(params=["on_simulated", "on_hamlib"])
def servo(request: pytest.FixtureRequest) -> Servo:
    """The live antenna on each drive, standing and whole, whatever the test before has left."""
    shared: Servo = request.getfixturevalue(request.param)
    shared.recover()
    return shared


@pytest.fixture(params=["on_simulated", "on_hamlib", "on_wall_time"])
def everywhere(request: pytest.FixtureRequest) -> Servo:
    """Those and the simulated drive in wall time, for the essential cases."""
    shared: Servo = request.getfixturevalue(request.param)
    shared.recover()
    return shared


@pytest.fixture
def in_wall_time(on_wall_time: Servo) -> Servo:
    on_wall_time.recover()
    return on_wall_time


@pytest.fixture
def simulated(on_simulated: Servo) -> Servo:
    """The same on the drive into which faults can be injected."""
    on_simulated.recover()
    return on_simulated


# Commands


def test_the_second_of_two_commanders_is_refused_and_both_are_named(everywhere: Servo) -> None:
    servo = everywhere
    servo.move(0.3)
    servo.rejected(servo.command(), "conflict: test commands, panel is refused", who="panel")
    assert servo.status.commander == "test"
    servo.ask("stop")


def test_a_second_participant_with_the_name_of_the_commander_moves_nothing(
    simulated: Servo, ros_domain: int, tmp_path: Path
) -> None:
    """It can read every message of the domain, but not the key; sent again, a signed command is out of order."""
    servo, heard = simulated, []
    servo.move(0.5)
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    foreign = rclpy.create_node("pointing_controller", namespace=f"{servo.live.namespace}/elsewhere", context=context)
    executor = make_executor(context)
    executor.add_node(foreign)
    kinds = {JointTrajectory: COMMANDS, CommandSignature: SIGNATURES}
    topics = {kind: f"{servo.live.namespace}/{name}" for kind, name in kinds.items()}
    try:
        senders = {kind: foreign.create_publisher(kind, topic, STREAM) for kind, topic in topics.items()}
        for kind, topic in topics.items():
            foreign.create_subscription(kind, topic, heard.append, STREAM, raw=kind is JointTrajectory)
        found = lambda: all(each.get_subscription_count() == 2 for each in senders.values())  # noqa: E731
        servo.live.spin_until(found, "both subscriptions")
        servo.until(lambda: servo.commanders.level == WARN, "the second publisher on /diagnostics")
        assert "2 publishers of" in servo.commanders.message
        accepted_s, pairs = time.monotonic() + 20.0, list[Any]()
        while not pairs and time.monotonic() < accepted_s:
            servo.move(0.1)
            for _ in kinds:
                executor.spin_once(timeout_sec=0.1)
            commands = {digest_of(each): each for each in heard if isinstance(each, bytes)}
            pairs = [(each, commands[each.digest]) for each in heard if getattr(each, "digest", "") in commands]
        (signature, replayed), *_ = pairs
        # It comes to rest: what moves it now is an attack.
        servo.clock.run(3.0)
        shifted = servo.command(positions=[START_RAD[0] + math.radians(10.2), START_RAD[1]])
        payload = serialize_message(shifted)
        guess = CommandKey(CommandKeyParams(command_key_file=str(tmp_path / "guessed")), topics[JointTrajectory])
        swapped = CommandSignature(header=signature.header, sequence=signature.sequence, commander="test",
            digest=digest_of(payload), key_id=signature.key_id, signature=signature.signature)  # fmt: skip
        for attack, reason in (
            ([payload], "conflict: a command without a signature"),
            ([signature, payload], "conflict: a command without a signature"),
            ([swapped, payload], "conflict: a command without a signature"),
            (
                [guess.sign(payload, shifted.header.stamp, 1, "test"), payload],
                "conflict: a command without a signature",
            ),
            ([signature, replayed], "stale"),
            ([replayed, signature], "stale"),
        ):
            # What was sent before is in the counts now.
            servo.clock.run(0.3)
            before, taken, stood = servo.status.commands_rejected, servo.status.commands_accepted, servo.joints[-1]
            for message in attack:
                senders[JointTrajectory if isinstance(message, bytes) else CommandSignature].publish(message)
            servo.until(lambda: servo.status.commands_rejected > before, "the refusal")  # noqa: B023
            assert reason in servo.status.last_rejection
            assert servo.status.commands_accepted == taken
            assert abs(servo.joints[-1] - stood) < math.radians(0.1)
        servo.until(lambda: servo.commanders.level == ERROR, "the conflict on /diagnostics")
        assert servo.commanders.message.startswith("conflict: a command")
        taken = servo.status.commands_accepted
        for number in range(10):
            for _ in range(20):
                senders[JointTrajectory].publish(payload + number.to_bytes(4, "little"))
                senders[CommandSignature].publish(swapped)
            servo.move(0.1)
        servo.until(lambda: servo.status.commands_accepted >= taken + 9, "the commands of the pass")
        assert servo.status.mode == "tracking", "the pass goes on"
    finally:
        executor.shutdown()
        foreign.destroy_node()
        rclpy.shutdown(context=context)
        servo.ask("stop")


def test_stop_pause_disable_park_and_stow_are_five_different_things(servo: Servo) -> None:
    servo.move(0.4)
    assert servo.ask("pause").success
    servo.mode("paused")
    servo.move(0.3)
    assert servo.status.mode == "paused"
    assert servo.ask("resume").success
    servo.move(0.2)
    assert servo.status.mode == "tracking"
    assert servo.ask("stop").success
    servo.mode("fault")
    servo.recover()
    assert servo.ask("disable").success
    servo.mode("disabled")
    servo.rejected(servo.command(), "the antenna is disabled; resume it first")
    assert servo.ask("resume").success
    servo.mode("holding")
    for name, mode in (("park", "parking"), ("stow", "stowing")):
        assert servo.ask(name).success
        servo.mode(mode)
        assert servo.status.transmit_inhibit == f"the antenna is {mode}"
        servo.ask("stop")
        servo.recover()


# Sensors and drive


@pytest.mark.parametrize(
    ("fault", "value_deg", "words", "within_s"),
    [
        ("encoder_frozen", 0.0, "encoder", 0.2),
        ("encoder_jump", 5.0, "jumped", 0.2),
        ("encoder_lie", 1.0, "more than the drive", 0.2),
        ("encoder_nan", 0.0, "must be a number", 0.2),
        ("runaway", 1.9, "drive runs at", 0.05),
        ("runaway", -1.9, "drive runs at", 0.05),
    ],
)
def test_a_broken_sensor_or_drive_is_cut_off_in_time(
    simulated: Servo, fault: str, value_deg: float, words: str, within_s: float
) -> None:
    """From the beginning of the first tick that is wrong to the end of that in which the brakes were set."""
    servo = simulated
    servo.move(0.8)
    assert servo.status.mode == "tracking", servo.status
    injected_s = servo.inject(fault, math.radians(value_deg))
    servo.move(0.4)
    assert servo.status.mode == "fault"
    assert words in servo.status.fault
    took_s = servo.fault_at() - injected_s
    print(f"{fault} {value_deg:+.1f}: brakes set after {1e3 * took_s:.0f} ms")
    assert took_s <= within_s + ROUNDING_S
    if fault == "encoder_nan":
        assert "the cause is still there" in servo.ask("reset_fault").message


# Clock and process


@pytest.mark.parametrize("jump_s", [5.0, -3.0])
def test_a_jump_of_the_clock_stops_the_antenna_and_never_makes_it_jump(servo: Servo, jump_s: float) -> None:
    servo.move(0.5)
    before = len(servo.joints)
    servo.clock.t_s += jump_s
    servo.until(lambda: "jumped by" in servo.status.fault, "the jump")
    assert float(re.search(r"jumped by ([-+.\d]+) s", servo.status.fault)[1]) == pytest.approx(jump_s, abs=0.1)
    servo.mode("fault")
    way = [servo.joints[before - 1], *servo.joints[before:]]
    # A rotator moves at its own speed from set point to set point, which are half a second apart.
    fastest, interval_s = (RATE_RAD_S, 0.0) if servo.simulated else (math.radians(6.0), 0.5)
    assert max(abs(b - a) for a, b in pairwise(way)) < 1.5 * fastest * TICK_S
    assert abs(way[-1] - way[0]) < RATE_RAD_S * (0.5 + interval_s), "a controlled stop"


def test_a_servo_that_was_frozen_discards_the_commands_that_waited(servo: Servo) -> None:
    servo.move(0.4)
    before = servo.joints[-1]
    process = servo.processes.process_id("antenna_servo")
    os.kill(process, signal.SIGSTOP)
    try:
        for _ in range(20):
            servo.clock.t_s = round(servo.clock.t_s + 0.1, 6)
            servo.send(servo.command())
        assert servo.heard_s < servo.now_s - 1.9
    finally:
        os.kill(process, signal.SIGCONT)
    servo.until(lambda: "jumped by" in servo.status.fault, "the jump of its clock")
    servo.mode("fault")
    assert servo.joints[-1] - before < RATE_RAD_S * 1.0, "2 s of commands were waiting, none of them was followed"


@pytest.mark.parametrize("stall_s", [1.1, 2.0, 5.0])
def test_a_servo_that_stalls_in_wall_time_follows_again_without_a_fault(in_wall_time: Servo, stall_s: float) -> None:
    """Nothing that waited is followed, and the axes do not jump; the next commands are."""
    servo = in_wall_time
    servo.move(1.0)
    assert servo.status.mode == "tracking"
    process = servo.processes.process_id("antenna_servo")
    before = len(servo.joints)
    os.kill(process, signal.SIGSTOP)
    try:
        servo.move(stall_s)
    finally:
        os.kill(process, signal.SIGCONT)
    resumed_s = time.monotonic()

    def follows() -> bool:
        servo.send(servo.command())
        on_line = servo.base_rad + RATE_RAD_S * (servo.now_s - (servo.begun_s or 0.0))
        return servo.status.mode == "tracking" and abs(servo.joints[-1] - on_line) < math.radians(0.05)

    while not follows():
        assert within(time.monotonic() - resumed_s, 5.0), servo.status
        assert servo.status.fault == ""
        servo.clock.run(0.1)
    print(f"stalled {stall_s} s, on the line again after {time.monotonic() - resumed_s:.1f} s")
    way = servo.joints[before - 1 :]
    assert max(abs(b - a) for a, b in pairwise(way)) < math.radians(2.0) * 3.0 * TICK_S, "no jump"
    servo.ask("stop")


def test_all_of_a_hundred_calls_at_once_are_answered_and_stop_in_time(in_wall_time: Servo) -> None:
    """While commands move it, from ten clients at once; stop comes last, from another."""
    servo, node = in_wall_time, in_wall_time.live.node
    space = f"{servo.live.namespace}/antenna_servo"
    clients = [node.create_client(Trigger, f"{space}/resume", qos_profile=SERVICE) for _ in range(10)]
    stop = node.create_client(Trigger, f"{space}/stop", qos_profile=SERVICE)
    for client in (*clients, stop):
        servo.live.spin_until(client.service_is_ready, client.srv_name)
    servo.move(1.0)
    begun_s = time.monotonic()
    answers = [client.call_async(Trigger.Request()) for client in clients for _ in range(10)]
    asked_s = time.monotonic()
    stopped = stop.call_async(Trigger.Request())
    while not stopped.done():
        servo.live.executor.spin_once(timeout_sec=0.001)
        assert within(time.monotonic() - asked_s, 5.0)
    stop_s = time.monotonic() - asked_s
    servo.live.spin_until(lambda: all(answer.done() for answer in answers), "every answer")
    print(f"stop answered after {1e3 * stop_s:.0f} ms, all 100 after {time.monotonic() - begun_s:.2f} s")
    assert stop_s < 1.0, "0.2 s where this process has a processor of its own"
    assert servo.status.mode in ("tracking", "stopping", "fault")
    for client in (*clients, stop):
        node.destroy_client(client)
