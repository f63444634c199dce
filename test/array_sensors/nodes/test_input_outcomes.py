"""What became of a node's input is counted, and the reason of a refusal is not forgotten."""

from rf_pointing.array_sensors.nodes.shared import InputOutcomes
from rf_pointing.ros.diagnostics import OK, WARN


def refuse() -> str:
    raise ValueError("phase has 3 values")


def test_closed_intake_does_nothing() -> None:
    intake, done = InputOutcomes(), []
    intake.take(lambda: done.append(1) or "")
    assert done == []
    assert intake.health().message == "nothing received yet"
    assert intake.health().level == WARN


def test_valid_invalid_and_rejected_messages_are_told_apart() -> None:
    intake = InputOutcomes()
    intake.open = True
    intake.take(lambda: "")
    assert (intake.health().level, intake.health().message) == (OK, "input is used")
    intake.take(lambda: "too weak")
    assert (intake.health().level, intake.health().message) == (WARN, "too weak")
    intake.take(refuse)
    assert intake.health().message == "phase has 3 values"
    assert intake.health().values == {"valid": 1, "invalid": 1, "rejected": 1, "last_rejection": "phase has 3 values"}
    intake.take(lambda: "")
    assert intake.health().level == OK
    assert intake.health().values["last_rejection"] == "phase has 3 values"
