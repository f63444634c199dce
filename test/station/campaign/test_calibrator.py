"""The calibrator: what its log and its models become; a campaign goes from pass to pass and says what failed."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.calibration import AcceptanceRules, BiasModel, ModelVersion, Observations, read_model
from rf_pointing.core import JointReading, PointingError, Target
from rf_pointing.station.campaign.calibrator import ORBIT, SECTORS, Calibrator, CalibratorParams, Campaign, journal_of
from rf_pointing.station.description import STATIONS
from test.calibration.conftest import one_pass

NOW_S = 1_200_000_000.0
STATION, BAND = "LEO 3.7 m", "X"
OFFSETS = ("azimuth_offset", "elevation_offset")
PLANTED = BiasModel.zero().replace(azimuth_offset=2e-3, elevation_offset=-1.5e-3)


def made(accept: str = "better", **given: Any) -> Calibrator:
    one = Calibrator(CalibratorParams(station=STATION, band=BAND, **given), AcceptanceRules(accept=accept))
    one.keeper.begin(NOW_S)
    return one


def rows(number: int, random: np.random.Generator) -> Observations:
    """Return the observations of a pass with the planted model."""
    return dataclasses.replace(one_pass(number, PLANTED, 1e-5, random, "rotation"), station=STATION, band=BAND)


def filled(folder: Path, random: np.random.Generator, passes: int = 6) -> None:
    for number in range(passes):
        journal_of(str(folder), STATION, BAND).append(rows(number, random))


def commissioned() -> ModelVersion:
    model = read_model(STATIONS / "bias_model_dss13_x.yaml")
    return dataclasses.replace(model, station=STATION, band=BAND, valid_from_t_s=NOW_S - 1.0)


def target(t_s: float) -> Target:
    return Target(
        t_s=t_s, name="bird", azimuth_rad=1.0, elevation_rad=0.5, azimuth_rate_rad_s=0.0, elevation_rate_rad_s=0.0,
        azimuth_acceleration_rad_s2=0.0, elevation_acceleration_rad_s2=0.0, range_m=1e6, range_rate_m_s=0.0,
        refraction_rad=0.0,
    )  # fmt: skip


def observe(one: Calibrator, t_s: float = NOW_S) -> None:
    for late_s in (-1.0, 1.0):
        one.log.take_target(target(t_s + late_s))
    reading = JointReading(t_s=t_s, position_rad=np.array([1.0, 0.5]), velocity_rad_s=np.zeros(2))
    error = PointingError(t_s=t_s, sensor="monopulse", cross_elevation_rad=1e-5, elevation_rad=-2e-5)
    one.take_error(error, reading)


def test_a_fit_of_kept_observations_becomes_a_candidate_and_is_put_in_force_and_back(
    tmp_path: Path, random: np.random.Generator
) -> None:
    filled(tmp_path, random)
    one = made("not worse", folder=str(tmp_path))
    with pytest.raises(ValueError, match="no model has been fitted"):
        one.accept(NOW_S)
    _, file, _ = one.fit(OFFSETS, "", ORBIT, NOW_S)
    assert (file.name, file.passes) == ("fit-1200000000", 6)
    for name in OFFSETS:
        assert file.model.coefficients[name] == pytest.approx(PLANTED.coefficients[name], abs=2e-4), name
    level, message, values = one.health()
    # Not a warning: a station need not have one, and it would stand for ever.
    assert (level, message) == (0, "no model: commands are not corrected")
    assert (values["candidate"], values["shadow"]) == ("fit-1200000000", "not yet observed in shadow")
    assert one.accept(NOW_S) == "fit-1200000000 is in force; it was not yet observed in shadow"
    one.fit(OFFSETS, "second", ORBIT, NOW_S)
    one.accept(NOW_S)
    assert one.roll_back() == "fit-1200000000 is in force again"
    assert one.health()[:2] == (0, "fit-1200000000")


def test_a_verdict_of_the_shadow_is_in_the_result_of_a_campaign(tmp_path: Path, random: np.random.Generator) -> None:
    filled(tmp_path, random)
    one = made(folder=str(tmp_path))
    one.fit(OFFSETS, "new", ORBIT, NOW_S)
    for number in range(10, 14):
        one.keeper.observe(rows(number, random))
    outcome = one.outcome(Campaign([PASSES["a"]], "", one.log, None, None), "")
    assert outcome["verdict"] == "better"
    assert "new is better after 4 passes in shadow" in outcome["message"]
    assert outcome["sectors_filled"] == SECTORS.count - len(one.log.coverage(SECTORS).thin) > 0


@pytest.mark.parametrize("keep", [True, False])
def test_an_observation_is_on_the_disk_before_the_next_where_that_is_wanted(tmp_path: Path, keep: bool) -> None:
    one = made(folder=str(tmp_path), keep_observations=keep)
    observe(one)
    assert len(one.log) == one.health()[2]["observations"] == 1
    assert len(list(tmp_path.rglob("observations*"))) == keep
    again = made(folder=str(tmp_path), keep_observations=keep)
    assert len(again.log) == keep


# Campaigns

PASSES = {name: SimpleNamespace(target=name) for name in "abcd"}


class Graph:
    """Nodes that answer a campaign as `fates` says, target by target; `log` has as many observations as it gave."""

    def __init__(self, fates: dict[str, str]) -> None:
        self.fates, self.requests, self.cancels, self.count, self.tracked = fates, [], 0, 0, True

    def __len__(self) -> int:
        return self.count

    def begin_pass(self) -> None:
        self.requests.append("begin")

    def reasons(self) -> str:
        return "7 errors: not valid"

    def select(self, wanted: Any) -> Any:
        self.requests.append(("select", wanted.target))
        answer = SimpleNamespace(success=self.fates[wanted.target] != "unknown", message="no such target")
        return self.answer(answer, self.fates[wanted.target] != "silent")

    def track(self, wanted: Any, sensor: str) -> Any:
        self.requests.append(("track", wanted.target, sensor))
        fate = self.fates[wanted.target]

        def end() -> Any:
            self.count += 5 * (fate == "observed")
            fault = "drives cut" if fate == "fault" else ""
            return SimpleNamespace(result=SimpleNamespace(seconds_tracked=1.0, message=fault or "lost", fault=fault))

        handle = SimpleNamespace(
            accepted=fate != "refused", cancel_goal_async=lambda: setattr(self, "cancels", self.cancels + 1),
            get_result_async=lambda: SimpleNamespace(done=lambda: self.tracked, result=end),
        )  # fmt: skip
        return self.answer(handle)

    def answer(self, value: Any, done: bool = True) -> Any:
        return SimpleNamespace(done=lambda: done, result=lambda: value)

    def campaign(self) -> Campaign:
        return Campaign([PASSES[name] for name in self.fates], "conscan", self, self.select, self.track)


WHY = {
    "unknown": "no such target", "refused": "the controller refused the pass", "silent": "no answer within 20 s",
    "empty": "no observation, 1 s on target, lost; 7 errors: not valid",
    "fault": "no observation, 1 s on target, drives cut; 7 errors: not valid",
}  # fmt: skip


@given(st.lists(st.sampled_from(["observed", *WHY]), min_size=1, max_size=4))
def test_each_pass_is_selected_and_tracked_in_turn_until_a_fault_and_what_failed_is_named(fates: list[str]) -> None:
    graph = Graph(dict(zip(PASSES, fates, strict=False)))
    campaign, wall_s = graph.campaign(), 0.0
    while not campaign.over:
        campaign.poll(wall_s)
        wall_s += 7.0
    end = fates.index("fault") + 1 if "fault" in fates else len(fates)
    assert (campaign.number, campaign.observed) == (end, fates[:end].count("observed"))
    assert campaign.failures == [f"{t}: {WHY[f]}" for t, f in zip(PASSES, fates[:end], strict=False) if f in WHY]
    assert campaign.fault == ("drives cut" if "fault" in fates else "")
    expected = []
    for target, fate in zip(PASSES, fates[:end], strict=False):
        expected += ["begin", ("select", target)]
        expected += [("track", target, "conscan")] if fate not in ("unknown", "silent") else []
    assert graph.requests == expected
    outcome = made().outcome(campaign, "")
    assert outcome["success"] is (campaign.observed == len(fates))
    stopped = f"stopped by a fault in pass {end} of {len(fates)}: drives cut; " if "fault" in fates else ""
    observed = f"{campaign.observed} of {len(fates)} passes observed, 0 observations"
    assert outcome["message"] == "; ".join([stopped + observed, *campaign.failures])
    assert made().progress(campaign)["progress"] == (end - 1) / len(fates)


def test_a_cancel_stops_the_pass_in_work_and_begins_no_other() -> None:
    graph = Graph({"a": "empty", "b": "observed"})
    campaign, graph.tracked = graph.campaign(), False
    for wall_s in (0.0, 1.0, 2.0, 1e6):
        campaign.poll(wall_s)
    assert (campaign.over, campaign.target) == (False, "a"), "a pass has no time to answer in"
    campaign.cancel()
    assert graph.cancels == 1
    graph.tracked = True
    campaign.poll(1e6)
    assert (campaign.over, campaign.number) == (True, 1)
    campaign.cancel()
    assert graph.cancels == 1
