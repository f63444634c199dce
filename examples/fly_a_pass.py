"""Flies one pass with rclpy alone, as a program of yours would: goal by name, feedback, errors, stop.

scripts/launch simulated_station station:=leo_3m7 elements:=my.tle
ros2 launch rf_pointing simulated_station.launch.py station:=leo_3m7 elements:=my.tle   # in ROS 2
python3 examples/fly_a_pass.py /gs1 MYSAT                  # Ctrl-C stops the antenna under control
"""

import signal
import sys
import threading

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rf_pointing_msgs.action import TrackPass


def fly(namespace: str, satellite: str, interrupted: threading.Event) -> int:
    """Fly the next pass of `satellite`; return 0 when it was tracked."""
    node = rclpy.create_node("fly_a_pass", namespace=namespace)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    client = ActionClient(node, TrackPass, "track_pass")
    if not client.wait_for_server(timeout_sec=10.0):
        print(f"no pointing_controller in {namespace}", file=sys.stderr)
        return 2
    sent = client.send_goal_async(TrackPass.Goal(satellite=satellite), feedback_callback=show)
    executor.spin_until_future_complete(sent)
    handle = sent.result()
    if not handle.accepted:
        print("rejected: another pass is tracked, or the controller is not active", file=sys.stderr)
        return 2
    ended, cancelled = handle.get_result_async(), False
    # After a cancel the result arrives when the antenna has come to rest.
    while not ended.done():
        executor.spin_once(timeout_sec=0.1)
        if interrupted.is_set() and not cancelled:
            handle.cancel_goal_async()
            cancelled = True
    result = ended.result().result
    # Whatever went wrong is a sentence; `fault` is what must be mended before the next pass.
    print(f"{result.target_pass.target or satellite}: {result.message}; {result.seconds_tracked:.0f} s held")
    if result.fault:
        print(f"fault: {result.fault}", file=sys.stderr)
    return 0 if result.success else 1


def show(message: TrackPass.Impl.FeedbackMessage) -> None:
    """Print one line a second."""
    status = message.feedback.status
    held = "held" if status.held else ""
    print(f"{message.feedback.progress:4.0%} {status.mode:<13} {held} {status.alarm}", flush=True)


if __name__ == "__main__":
    # Ctrl-C must cancel the goal: neither end rclpy under it nor leave its executor in the middle of a callback.
    interrupted = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: interrupted.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    sys.exit(fly(*(sys.argv[1:] if len(sys.argv) == 3 else ("/gs1", "28057")), interrupted))
