"""A change of band on a running node: the numbers of a start in that band, in force at once, and back again."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rf_pointing_msgs.msg import PointingModel, StationInUse

from rf_pointing.core import MonopulseCluster
from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.nodes.bias_calibrator import BiasCalibrator
from rf_pointing.nodes.conscan_tracker import ConscanTrackerNode
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.nodes.monopulse_tracker import MonopulseTrackerNode
from rf_pointing.nodes.rf_receiver import RfReceiver
from rf_pointing.nodes.station_description import StationDescriptionNode
from rf_pointing.ros import convert
from rf_pointing.station.description import read_station

MakeBench = Callable[..., Any]
FOLLOW = (
    AntennaServo, BiasCalibrator, ConscanTrackerNode, EphemerisPublisher, MonopulseTrackerNode, RfReceiver,
    StationDescriptionNode,
)  # fmt: skip


def lead(bench: Any, band: str, digest: str = "") -> None:
    """Publish as a pointing controller that uses `band`."""
    station = bench.node.station
    bench.give("band_in_use", StationInUse(station=station.name, band=band, digest=digest or station.digest))


def values(bench: Any) -> dict[str, Any]:
    node = bench.node
    return {name: list(v) if hasattr(v := node.get_parameter(name).value, "__len__") and not isinstance(v, str) else v
            for name in node.parameters.names()}  # fmt: skip


@pytest.mark.parametrize("kind", FOLLOW)
def test_a_node_that_follows_has_the_numbers_of_a_start_in_that_band_and_those_of_before_on_the_way_back(
    make_bench: MakeBench, kind: Any
) -> None:
    bench = make_bench(kind).up()
    station, name, before = bench.node.station, bench.node.get_name(), values(bench)
    lead(bench, "S")
    expected, own = station.parameters(name, "S"), station.parameters(name, "X")
    changed = {each for each, value in expected.items() if own.get(each) != value}
    assert {each: values(bench)[each] for each in changed} == {each: expected[each] for each in changed}
    assert [each.band for each in bench.sent["station_in_use"]] == ["X", "S"]
    lead(bench, "X")
    assert values(bench) == before | {"band": "X"}
    assert bench.node.active


def test_a_node_on_another_description_or_that_cannot_follow_stays_in_its_band(
    make_bench: MakeBench, tmp_path: Path
) -> None:
    bench = make_bench(MonopulseTrackerNode, calibration_file=str(tmp_path / "feed.yaml")).up()
    lead(bench, "S", digest="b" * 16)
    (tmp_path / "feed_Ka.yaml").write_text("format: of another program\n")
    before = values(bench)
    lead(bench, "Ka")
    assert (bench.node.band, values(bench)) == ("X", before | {"band": "X"})
    assert any("feed_Ka.yaml: format must be" in words for _, words in bench.log)
    assert [each.band for each in bench.sent["station_in_use"]] == ["X"]


def test_what_a_tracker_measures_is_in_beams_of_its_band_at_once(make_bench: MakeBench) -> None:
    bench, samples = make_bench(MonopulseTrackerNode).up(), np.full(3, 1.0 + 0.0j)
    cluster = MonopulseCluster(
        t_s=1.8e9 + 0.02 * np.arange(3), sum=samples, difference_cross_elevation=0.01 * samples,
        difference_elevation=0.02 * samples, carrier_to_noise_db_hz=60.0,
    )  # fmt: skip
    for band in ("X", "S", "Ka"):
        lead(bench, band)
        bench.give("monopulse", convert.monopulse_to_message(cluster))
    widths = [read_station("dss13").parameters("monopulse_tracker", band)["monopulse.half_power_beamwidth_deg"]
              for band in ("X", "S", "Ka")]  # fmt: skip
    errors = [each.cross_elevation for each in bench.sent["pointing_error"]]
    assert np.array(errors) / errors[0] == pytest.approx(np.array(widths) / widths[0], rel=1e-9)


@pytest.mark.parametrize("offset_deg", [0.0, 0.9])
def test_the_calibrator_publishes_the_model_of_each_band_and_that_of_the_feed_where_there_is_none(
    make_bench: MakeBench, tmp_path: Path, offset_deg: float
) -> None:
    read_station("leo_3m7").write(tmp_path / "dish.yaml", {"bands.S.feed_offset.cross_elevation_deg": offset_deg})
    bench = make_bench(BiasCalibrator, station=str(tmp_path / "dish.yaml")).up()
    lead(bench, "S")
    model: PointingModel = bench.sent["pointing_model"][-1]
    found = dict(zip(model.terms, model.values, strict=True))
    assert (model.band, found["collimation"]) == ("S", pytest.approx(-math.radians(offset_deg)))
    assert model.name == ("feed offset" if offset_deg else "none")
    lead(bench, "X")
    assert (bench.sent["pointing_model"][-1].band, bench.sent["pointing_model"][-1].name) == ("X", "none")
