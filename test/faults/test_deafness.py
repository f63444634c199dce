"""A live node whose input is taken away by packets with moved sequence numbers ends, to be started again.

What is sent is a heartbeat of RTPS in the name of a writer: "my first message is number 10^9".  The reader takes every
later message of that writer for one that it has, and its real heartbeats for old ones.
"""

import socket
import struct
import time
from types import SimpleNamespace

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from rf_pointing_msgs.msg import TrackingStatus

from rf_pointing.ros.main_loop import DEAF
from rf_pointing.ros.qos import STREAM

pytestmark = pytest.mark.graph
NAMES = ["antenna_servo", "ephemeris_publisher", "pointing_controller"]
FAR = 10**9
PARTICIPANTS = 32
LATEST_S = 50.0
"""For the silence of ten seconds that counts only while the publisher is heard, on a loaded machine."""


def heartbeat(writer_gid: bytes, count: int) -> bytes:
    """Return a datagram that says, for all readers of a writer, that its first and last message is number `FAR`."""
    prefix, entity = writer_gid[:12], writer_gid[12:16]
    number = struct.pack("<iI", FAR >> 32, FAR & 0xFFFFFFFF)
    body = bytes(4) + entity + number + number + struct.pack("<i", count)
    return b"RTPS\x02\x03\x01\x0f" + prefix + struct.pack("<BBH", 0x07, 0x03, len(body)) + body


def user_ports(domain: int) -> list[int]:
    """Return the ports of user data of the participants of a domain."""
    return [7400 + 250 * domain + 11 + 2 * number for number in range(PARTICIPANTS)]


def test_a_node_made_deaf_by_moved_sequence_numbers_says_so_and_ends(live: SimpleNamespace, ros_domain: int) -> None:
    said: list[TrackingStatus] = []
    live.node.create_subscription(TrackingStatus, "tracking_status", said.append, STREAM)
    processes = live.start(NAMES, autostart=True, processes=8)
    live.spin_until(lambda: len(said) > 5, "tracking_status")
    live.spin_until(lambda: 0.0 <= said[-1].axis_age < 1.0, "joint states at the controller")
    found = live.node.get_publishers_info_by_topic(f"{live.namespace}/joint_states")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for count in range(300):
            for port in user_ports(ros_domain):
                sender.sendto(heartbeat(bytes(found[0].endpoint_gid), 10**6 + count), ("127.0.0.1", port))
    attacked_s = time.monotonic()
    live.spin_until(lambda: said[-1].axis_age > 2.0, "the controller to be deaf")
    live.spin_until(lambda: "pointing_controller" in processes.ended(), "the end of the controller")
    print(f"deaf since {time.monotonic() - attacked_s:.1f} s when it ended")
    assert time.monotonic() - attacked_s < LATEST_S
    assert processes.ended() == {"pointing_controller": DEAF}, "the others hear and go on"
    words = processes.complaint("pointing_controller")
    # The thread of Fast DDS that receives may be busy with 10^9 lost messages.
    assert "joint_states has been silent for" in words or "has computed for 2 s and never waited" in words
    processes.start(["pointing_controller"], simulated_time=False, autostart=True)
    said.clear()
    live.spin_until(lambda: bool(said) and 0.0 <= said[-1].axis_age < 1.0, "the controller that started again")
