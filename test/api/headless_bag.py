"""Bags of passes that the headless station has flown: what a recorder of the graph would have written."""

import dataclasses
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rf_pointing.core import AXES
from rf_pointing.ephemeris import Pass
from rf_pointing.report.bag_writer import BagWriter
from rf_pointing.report.definitions import definitions
from rf_pointing.report.recorded_signals import LAYOUTS, wire_name
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.simulation.open_loop import Signals, time_of
from test.report.conftest import MSG_DEFS, Maker, offered_qos

RENAMED = {"half_power_beamwidth_rad": "beamwidth", "integration_s": "integration_time", "name": "target"}


class HeadlessBag:
    """One flown pass; `write` leaves its bag with `station.yaml` and `run.yaml` beside it, as `track` does."""

    def __init__(self, setup: StationSetup, window: Pass, start_s: float, sensor: str) -> None:
        self.setup, self.window, self.sensor, self.signals = setup, window, sensor, Signals()
        self.log = simulate_pass(setup, window, start_s, sensor, on_signal=self.signals.take)

    def write(
        self, folder: Path, *, without: Collection[str] = (), hole_s: tuple[float, float] = (0.0, 0.0),
        wind: Any = (), run: bool = True,
    ) -> Path:  # fmt: skip
        """Write all but the topics `without`, and nothing in the `hole_s`; `wind` is (time, east, north) in rows."""
        folder.mkdir()
        types = definitions(MSG_DEFS)
        maker, description = Maker(types), self.setup.station
        description.write(folder / "station.yaml", {})
        if run:
            sections = {f"/**/{node}": {"ros__parameters": values} for node, values in self.setup.changes.items()}
            (folder / "run.yaml").write_text(yaml.safe_dump(sections))
        rows = [
            (time_of(each), topic, _fields(maker, topic, each))
            for topic, stream in self.signals.topics.items()
            for each in stream
        ]
        first_s = min(rows, key=lambda row: row[0])[0]
        one = maker.message("rf_pointing_msgs/msg/Pass", **_named(maker, "rf_pointing_msgs/msg/Pass", self.window))
        model = self.setup.model.coefficients
        rows += [
            (first_s, "passes", {"target": self.window.name, "passes": [one]}),
            (first_s, "pointing_model", {"terms": list(model), "values": np.array(list(model.values()))}),
            (first_s, "station_in_use", {"node": "n", "digest": description.digest}),
        ]
        for t_s, east, north in wind:
            rows.append((t_s, "weather/wind", {"vector": maker.message("geometry_msgs/msg/Vector3", x=east, y=north)}))
        notes = {"station": description.name, "band": self.setup.band, "sensor": self.sensor}
        with BagWriter(folder / "bag", types, notes=notes) as bag:
            for topic in dict.fromkeys(topic for _, topic, _ in rows):
                bag.register(f"/gs1/{topic}", LAYOUTS[topic].type_name, [offered_qos()])
            for t_s, topic, fields in sorted(rows, key=lambda row: row[0]):
                if topic in without or hole_s[0] < t_s < hole_s[1]:
                    continue
                stamp_ns = round(t_s * 1e6) * 1000
                fields["header"] = maker.header(stamp_ns)
                bag.write(f"/gs1/{topic}", stamp_ns, maker.serialized(LAYOUTS[topic].type_name, **fields))
        return folder / "bag"


def _named(maker: Maker, kind: str, signal: Any) -> dict[str, Any]:
    """Return the fields of a message that a signal has, by the names of the wire."""
    known, found = dict(maker.store.fielddefs[kind][1]), {}
    for each in dataclasses.fields(signal):
        name, value = RENAMED.get(each.name, wire_name(each.name)), getattr(signal, each.name)
        if name in known and each.name != "t_s":
            if each.name.endswith("_t_s"):
                value = maker.time(round(value * 1e6) * 1000)
            if isinstance(value, np.ndarray | tuple):
                value = np.ravel(value).astype(maker.blank(known[name]).dtype)
            found[name] = str(value) if isinstance(value, str) else value
    return found


def _fields(maker: Maker, topic: str, signal: Any) -> dict[str, Any]:
    if topic == "joint_states":
        return {"name": list(AXES), "position": signal.position_rad, "velocity": signal.velocity_rad_s}
    if topic == "joint_trajectory":
        sent_s, motion = signal
        points = []
        for t_s, *row in zip(
            motion.t_s, motion.position_rad, motion.velocity_rad_s, motion.acceleration_rad_s2, strict=True
        ):
            micros = round((t_s - sent_s) * 1e6)
            since = maker.message("builtin_interfaces/msg/Duration", sec=micros // 10**6, nanosec=micros % 10**6 * 1000)
            columns = dict(zip(("positions", "velocities", "accelerations"), row, strict=True))
            points.append(maker.message("trajectory_msgs/msg/JointTrajectoryPoint", time_from_start=since, **columns))
        return {"joint_names": list(AXES), "points": points}
    found = _named(maker, LAYOUTS[topic].type_name, signal)
    if topic == "target" and (sure := signal.uncertainty) is not None:
        found |= {"covariance": sure.covariance_rad2.ravel(), "element_age": sure.age_s}
        found |= {"along_track_sigma": sure.along_track_rad, "cross_track_sigma": sure.cross_track_rad}
        found["along_track_time_sigma"] = sure.along_track_s
    if topic == "monopulse":
        for name in ("sum", "difference_cross_elevation", "difference_elevation"):
            samples = getattr(signal, name)
            found |= {f"{name}_i": samples.real.copy(), f"{name}_q": samples.imag.copy()}
        found["sample_period"] = round(float(signal.t_s[1] - signal.t_s[0]), 6)
    return found
