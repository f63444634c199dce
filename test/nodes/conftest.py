"""Nodes in a context of their own, in this session's domain; without ROS there is nothing to collect here."""

import importlib.util
from collections.abc import Callable, Iterator
from typing import Any

import pytest

collect_ignore_glob = [] if importlib.util.find_spec("rclpy") else ["test_*.py"]


@pytest.fixture
def ros_context(ros_domain: int) -> Iterator[Any]:
    """Yield a private context."""
    import rclpy
    from rclpy.context import Context

    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    yield context
    context.try_shutdown()


@pytest.fixture
def make_node(ros_context: Any) -> Iterator[Callable[..., Any]]:
    """Yield a maker of plain nodes; keyword `given` holds parameter values as a file would give them."""
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    made: list[Any] = []

    def make(name: str = "subject", given: dict[str, Any] | None = None) -> Any:
        overrides = [Parameter(key, value=value) for key, value in (given or {}).items()]
        node = Node(name, context=ros_context, namespace="/test", parameter_overrides=overrides)
        made.append(node)
        return node

    yield make
    for node in made:
        node.destroy_node()


@pytest.fixture
def default_context(ros_domain: int) -> Iterator[None]:
    """Initialise the default context, which managed nodes use."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
    yield
    rclpy.try_shutdown()
