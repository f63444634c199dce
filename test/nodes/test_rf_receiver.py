"""The simulated receiver's node: it follows the selected satellite, and publishes while it is active."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rf_pointing_msgs.msg import Boresight, PassList

from rf_pointing.nodes import rf_receiver
from rf_pointing.nodes.rf_receiver import RfReceiver
from rf_pointing.ros import convert

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")


@pytest.fixture
def receiver(default_context: None) -> Iterator[Any]:
    """Yield a receiver that is not configured."""
    node = RfReceiver()
    yield node
    node.end()
    node.lock.release()
    node.destroy_node()


def test_a_receiver_tunes_to_the_selected_satellite_once(receiver: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    assert receiver.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    assert {"sim/boresight", "passes"} <= {each.topic_name.lstrip("/") for each in receiver.subscriptions}
    tuned: list[str] = []
    monkeypatch.setattr(rf_receiver, "load_track", lambda source: source.satellite)
    receiver._receiver = SimpleNamespace(target="BIRD", tune=tuned.append)
    for target in ("", "BIRD", "25544"):
        receiver._on_passes(PassList(target=target))
    assert tuned == ["25544"]


def test_samples_are_published_while_the_node_is_active(receiver: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    assert receiver.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    sent: dict[str, list[Any]] = {"cluster": [], "power": [], "truth": []}
    receiver._monopulse, receiver._power, receiver._truth = (
        SimpleNamespace(publish=rows.append) for rows in sent.values()
    )
    for name in ("boresight_from_message", "monopulse_to_message", "power_to_message", "error_to_message"):
        monkeypatch.setattr(convert, name, lambda each: each)
    receptions = [SimpleNamespace(cluster="c", power="p", truth="t"), None]
    receiver._receiver = SimpleNamespace(take=lambda _boresight: receptions.pop())
    receiver._on_boresight(Boresight())
    assert len(receptions) == 2
    receiver.on_activate(ANY_STATE)
    receiver._on_boresight(Boresight())
    assert sent == {"cluster": [], "power": [], "truth": []}
    receiver._on_boresight(Boresight())
    assert sent == {"cluster": ["c"], "power": ["p"], "truth": ["t"]}


def test_elements_that_were_never_fetched_refuse_the_configuration(receiver: Any) -> None:
    receiver.set_parameters([Parameter("source.elements", value="https://example.invalid/never.tle")])
    assert receiver.on_configure(ANY_STATE) == TransitionCallbackReturn.FAILURE
    assert "never.tle" in receiver._reason
