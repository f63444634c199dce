"""Every registered check becomes one status; a check that fails is an error of its subject."""

from collections.abc import Callable
from typing import Any

from rf_pointing.nodes.diagnostics import ERROR, OK, WARN, Diagnostics, Health


class Caught:
    """Stands for the publisher."""

    def __init__(self) -> None:
        self.arrays: list[Any] = []

    def publish(self, array: Any) -> None:
        self.arrays.append(array)


def published(node: Any, **checks: Callable[[], Health]) -> list[Any]:
    diagnostics = Diagnostics(node)
    for name, check in checks.items():
        diagnostics.add(name, check)
    diagnostics._publisher = caught = Caught()
    diagnostics.publish()
    (array,) = caught.arrays
    return list(array.status)


def test_a_check_gives_a_status_with_name_level_message_and_values(make_node: Callable[..., Any]) -> None:
    (status,) = published(make_node(), drive=lambda: Health(WARN, "at its limit", {"axis": "azimuth", "count": 3}))
    assert status.name == "test/subject: drive"
    assert status.hardware_id == "/test/subject"
    assert (status.level, status.message) == (WARN, "at its limit")
    assert [(value.key, value.value) for value in status.values] == [("axis", "azimuth"), ("count", "3")]


def test_a_check_that_cannot_be_made_is_an_error_and_hides_no_other(make_node: Callable[..., Any]) -> None:
    def broken() -> Health:
        raise ValueError("t_s=3 is outside the elements")

    first, second = published(make_node(), broken=broken, fine=Health)
    assert (first.level, first.message) == (ERROR, "t_s=3 is outside the elements")
    assert (second.level, second.message) == (OK, "ok")


def test_health_objects_share_no_values() -> None:
    Health().values["x"] = 1
    assert Health().values == {}


def test_they_go_to_the_absolute_topic(make_node: Callable[..., Any]) -> None:
    assert Diagnostics(make_node())._publisher.topic_name == "/diagnostics"
