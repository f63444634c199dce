"""check_receiver's lines, on a good receiver and on each fault that it must find."""

from typing import Any

import pytest

from rf_pointing.receiver import IqSamples, SignalReceiver, Source
from rf_pointing.receiver.conformance import ReceiverCheck
from test.receiver.planted import PIECE_S, Planted


class PlantedSource(Source):
    """A planted stream as a source in the time of the test."""

    planted: Planted
    faults: dict[str, Any]

    def step(self) -> list[Any]:
        piece = self.planted.piece()
        self.problem = self.faults.get("problem", "")
        if self.faults.get("silent"):
            return []
        late_s = self.faults.get("late_s", 0.0)
        return [IqSamples(piece.samples, piece.rate_hz, piece.index, piece.arrival_s,
                          t_s=piece.arrival_s - PIECE_S - late_s, clipped=piece.clipped)]  # fmt: skip

    def end(self) -> None:
        """Nothing to end."""


def checked(planted: Planted, **faults: Any) -> dict[str, Any]:
    source = PlantedSource(planted.params, lambda: planted.time_s(planted.index))
    source.planted, source.faults = planted, faults
    receiver = SignalReceiver(planted.params, source.now_s, source)
    receiver.meter.doppler = planted.meter.doppler
    check = ReceiverCheck(receiver, source.now_s)
    return {line.name: line for line in check.lines(6.0)}


def test_a_good_receiver_passes_every_line() -> None:
    lines = checked(Planted(55.0))
    assert all(line.passed for line in lines.values()), [str(line) for line in lines.values()]
    assert list(lines) == ["connection", "period", "latency", "rate", "clipping", "interference", "signal", "sigma",
                           "losses"]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "planted", "faults"),
    [
        ("connection", {}, {"problem": "rtl_tcp at localhost:1234: Connection refused"}),
        ("period", {}, {"silent": True}),
        ("latency", {}, {"late_s": 0.7}),
        ("clipping", {"radio": {"noise_dbfs": -3.0, "bits": 8}}, {}),
        ("interference", {"radio": {"line_db_hz": 60.0, "line_offset_hz": 25e3}}, {}),
        ("signal", {"level": -20.0}, {}),
    ],
)
def test_each_fault_fails_its_line(name: str, planted: dict[str, Any], faults: dict[str, Any]) -> None:
    lines = checked(Planted(**{"level": 55.0, **planted}), **faults)
    assert not lines[name].passed
    if name == "connection":
        assert list(lines) == ["connection"]
        assert "Connection refused" in str(lines[name])
