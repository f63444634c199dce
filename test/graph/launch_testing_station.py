"""The simulated station under `launch_testing`: `launch_test test/graph/launch_testing_station.py`.

Every node becomes active by itself, and each process ends with 0 when the launch is ended.
"""

import unittest
from pathlib import Path
from typing import Any

import launch_testing
import launch_testing.actions
import launch_testing.asserts
import rclpy
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState

from launch import LaunchDescription
from rf_pointing.ros.graph import NODES

NAMESPACE = "launch_testing"
FILE = Path(__file__).parents[2] / "launch" / "simulated_station.launch.py"


def generate_test_description() -> LaunchDescription:
    """Return the launch file, and the word that the tests may begin."""
    arguments = {
        "namespace": NAMESPACE, "speed": "4.0", "state_folder": "none", "station": "dss13",
        "satellite": "Moon",
    }  # fmt: skip
    station = IncludeLaunchDescription(PythonLaunchDescriptionSource(str(FILE)), launch_arguments=arguments.items())
    return LaunchDescription([station, launch_testing.actions.ReadyToTest()])


class TestTheStationComesUp(unittest.TestCase):
    """While the launch runs."""

    def test_every_node_becomes_active(self) -> None:
        rclpy.init()
        node = rclpy.create_node("launch_testing_client")
        try:
            waiting = {name: node.create_client(GetState, f"/{NAMESPACE}/{name}/get_state") for name in NODES}
            deadline_s = node.get_clock().now().nanoseconds * 1e-9 + 90.0
            while waiting and node.get_clock().now().nanoseconds * 1e-9 < deadline_s:
                for name, client in list(waiting.items()):
                    if not client.wait_for_service(timeout_sec=1.0):
                        continue
                    future = client.call_async(GetState.Request())
                    rclpy.spin_until_future_complete(node, future, timeout_sec=2.0)
                    if future.done() and future.result().current_state.id == State.PRIMARY_STATE_ACTIVE:
                        del waiting[name]
            assert not waiting, sorted(waiting)
        finally:
            node.destroy_node()
            rclpy.shutdown()


@launch_testing.post_shutdown_test()
class TestTheStationEnds(unittest.TestCase):
    """After the launch was ended."""

    def test_each_process_ends_with_0(self, proc_info: Any) -> None:
        launch_testing.asserts.assertExitCodes(proc_info)
