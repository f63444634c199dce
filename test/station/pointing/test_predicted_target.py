"""The predicted target: its passes, what changes it, what it cannot tell, and what is there after a restart."""

import dataclasses
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import RadioRefraction, utc_text
from rf_pointing.ephemeris import ElementUncertainty, find_elements, sky_uncertainty, tle_lines, verification_elements
from rf_pointing.ephemeris.earth_orientation import orientation_table
from rf_pointing.ephemeris.satellite_antenna import SatelliteAntennaParams
from rf_pointing.ephemeris.source import SourceParams, load_track
from rf_pointing.planning import HorizonMask
from rf_pointing.station.pointing.predicted_target import PredictedTarget, PublisherParams

CBERS = find_elements(verification_elements(), "28057")
NOW_S = 1_151_384_500.0


class Bench:
    """A target at a time of June 2006, and what was shown and logged."""

    def __init__(self, source: SourceParams | None = None, *, begin: bool = True, **params: Any) -> None:
        self.lists: list[Any] = []
        self.profiles: list[Any] = []
        self.logged: list[tuple[str, str]] = []
        self.target = PredictedTarget(
            PublisherParams(**params), source or SourceParams(), HorizonMask(), ElementUncertainty(), self._show,
            lambda *words: self.logged.append(words),
        )  # fmt: skip
        if begin:
            assert self.target.begin(NOW_S) == ""

    def _show(self, passes: Any, profiles: Any) -> None:
        self.lists += [passes] if passes else []
        self.profiles.append(profiles)

    def set(self, now_s: float = NOW_S, **changes: Any) -> None:
        self.target.set(self.target.source.replace(**changes), now_s)

    def problem(self, now_s: float = NOW_S) -> str:
        level, message, _ = self.target.health(now_s)
        return message if level else ""

    def between_s(self) -> float:
        first, second = self.target.passes[:2]
        return 0.5 * (first.los_t_s + second.aos_t_s)


def test_passes_and_profiles_are_shown_with_each_choice() -> None:
    one = Bench()
    passes = one.target.passes
    assert one.lists == [passes]
    assert [each.name for each in one.profiles[0]] == [each.name for each in passes] == ["CBERS 2"] * len(passes)
    assert passes[-1].aos_t_s < NOW_S + 86400.0
    lowest, *_ = sorted(window.peak_elevation_rad for window in passes)
    assert one.target.select("", NOW_S, lowest + 1e-9) == [w for w in passes if w.peak_elevation_rad > lowest]
    later = one.target.select("", passes[0].los_t_s + 60.0, 0.0)
    assert later[0].aos_t_s == pytest.approx(passes[1].aos_t_s, abs=1e-3)
    assert len(one.lists) == len(one.profiles) == 3


def test_a_target_is_due_ahead_of_its_time_in_and_around_a_pass() -> None:
    one = Bench(lead_s=3.0, margin_s=7.0)
    window = one.target.passes[1]
    first_s, last_s = window.aos_t_s - 10.0, window.los_t_s + 4.0
    due = [one.target.target_at(t_s) is not None for t_s in (first_s - 0.1, first_s + 0.1, last_s - 0.1, last_s + 0.1)]
    assert due == [False, True, True, False]
    now_s = math.floor(window.tca_t_s)
    target = one.target.target_at(now_s)
    assert dataclasses.replace(target, uncertainty=None) == load_track(SourceParams()).target_at(now_s + 3.0)
    assert target.uncertainty.covariance_rad2 == pytest.approx(
        sky_uncertainty(load_track(SourceParams()), now_s + 3.0, ElementUncertainty()).covariance_rad2
    )


def test_a_target_that_does_not_pass_leaves_the_present_one_in_force() -> None:
    one = Bench(begin=False, span_s=360.0)
    words = one.target.begin(NOW_S + 3000.0)
    assert re.match(r"CBERS 2 has no pass above 0\.0 deg in the 0\.1 h after 2006-06-27T05:51:40", words)
    assert one.problem().startswith(words)
    one.target.params = PublisherParams(span_s=5400.0)
    assert one.target.select("CBERS 2", NOW_S, 0.0)
    assert one.problem() == ""
    passes, track = one.target.passes, one.target.track
    with pytest.raises(ValueError, match=r"^CBERS 2 has no pass above 89\.0 deg in the 1\.5 h after "):
        one.target.select("", NOW_S, math.radians(89.0))
    with pytest.raises(ValueError, match="nobody"):
        one.target.select("nobody", NOW_S, 0.0)
    assert (one.target.passes, one.target.track, one.target.peak_rad, len(one.lists)) == (passes, track, 0.0, 1)


def test_what_was_chosen_and_set_is_in_force_after_a_restart(tmp_path: Path) -> None:
    file = str(tmp_path / "target.json")
    one = Bench(state_file=file)
    one.target.select("CBERS 2", NOW_S, 0.25)
    one.set(hold=True, along_track_offset_s=1.5)
    again = Bench(state_file=file).target
    assert (again.peak_rad, again.track.hold_t_s, again.source) == (0.25, NOW_S, one.target.source)
    values = again.health(NOW_S)[2]
    assert (values["along_track_offset_s"], values["hold_since"][:19]) == (1.5, "2006-06-27T05:01:40")


@pytest.mark.parametrize(("margin_days", "stale"), [(-0.001, True), (0.001, False)])
@pytest.mark.parametrize("which", [0, 1])
def test_elements_are_stale_by_their_age_at_the_next_closest_approach(
    margin_days: float, stale: bool, which: int
) -> None:
    one = Bench()
    window = one.target.passes[which]
    one.set(stale_days=(window.tca_t_s - CBERS.epoch_t_s) / 86400.0 + margin_days)
    assert ("elements of CBERS 2 are stale" in one.problem(window.los_t_s)) is stale


def test_beyond_the_table_of_the_earth_the_target_goes_on_and_health_states_the_error(tmp_path: Path) -> None:
    after_s = orientation_table().span_t_s[1] + 1.5 * 86400.0
    file = tmp_path / "late.tle"
    file.write_text("\n".join(("LATE", *tle_lines(dataclasses.replace(CBERS, epoch_t_s=after_s - 3600.0)))))
    one = Bench(SourceParams(elements=str(file), satellite=""), begin=False)
    assert one.target.begin(after_s) == ""
    tca_s = one.target.passes[0].tca_t_s
    assert one.target.target_at(tca_s) is not None
    level, message, values = one.target.health(tca_s)
    assert level == 1
    assert "beyond the table that ends on" in message
    # 0.1 s of the Earth's turn is 50 m, seen from 1000 to 3000 km.
    assert 2e-4 < values["earth_orientation_sigma_deg"] < 5e-3
    assert Bench().target.health(NOW_S)[2]["earth_orientation_sigma_deg"] == 0.0


def oem(path: Path, states: int = 13, step_s: float = 60.0) -> float:
    """Write twelve minutes of CBERS 2, whose pass goes on for 20 s more, and return where they end."""
    first_s, record = NOW_S - 200.0, CBERS.satrec()
    times = first_s + step_s * np.arange(states)
    rows = [(utc_text(t)[:-1], *np.ravel(record.sgp4_tsince((t - CBERS.epoch_t_s) / 60.0)[1:])) for t in times]
    meta = {
        "OBJECT_NAME": "BIRD", "OBJECT_ID": "2003-049A", "CENTER_NAME": "EARTH", "REF_FRAME": "TEME", "TIME_SYSTEM": "UTC",
        "START_TIME": rows[0][0], "STOP_TIME": rows[-1][0], "INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "9",
    }  # fmt: skip
    lines = ["CCSDS_OEM_VERS = 2.0", "META_START", *(f"{key} = {value}" for key, value in meta.items()), "META_STOP"]
    path.write_text("\n".join([*lines, *(" ".join(map(str, row)) for row in rows)]))
    return float(times[-1])


def test_what_cannot_be_told_ends_the_targets_until_it_can_and_is_an_error(tmp_path: Path) -> None:
    end_s = oem(tmp_path / "bird.oem")
    one = Bench(SourceParams(elements=str(tmp_path / "bird.oem"), satellite="BIRD"))
    late_s = end_s - 40.0
    assert one.target.target_at(late_s) is not None
    one.set(along_track_offset_s=50.0)
    assert one.target.target_at(late_s) is None
    assert one.target.target_at(late_s - 20.0) is not None


def test_the_measured_weather_bends_the_rays_where_it_has_changed_and_its_age_is_reported() -> None:
    one = Bench(SourceParams(refraction="measured"))
    assert "weather" not in one.problem(), "nothing has come"
    measured = {"pressure_hpa": 940.0, "temperature_k": 308.0, "relative_humidity": 0.2}
    for name, value in measured.items():
        one.target.take_weather(name, value, NOW_S)
    assert one.target.renew(NOW_S) == ("", False)
    low = math.radians(5.0)
    assert one.target.track.refraction.apply(low) == pytest.approx(RadioRefraction(**measured).apply(low), abs=1e-12)
    for name, step, used in (
        ("temperature_k", 0.45, False), ("temperature_k", -0.55, True), ("pressure_hpa", -0.45, False),
        ("pressure_hpa", 0.55, True), ("relative_humidity", 0.018, False), ("relative_humidity", -0.022, True),
    ):  # fmt: skip
        before = getattr(one.target.source.weather, name)
        one.target.take_weather(name, before + step, NOW_S)
        one.target.renew(NOW_S)
        assert getattr(one.target.source.weather, name) == (before + step if used else before), (name, step)
    one.target.take_weather("relative_humidity", 7.0, NOW_S)
    one.target.renew(NOW_S)
    assert "measured weather is not used: relative_humidity=7.0" in one.problem()
    one.target.take_weather("relative_humidity", 0.3, NOW_S)
    one.target.renew(NOW_S)
    assert "weather" not in one.problem(NOW_S + 3599.0)
    assert "the measured weather is 1.0 h old" in one.problem(NOW_S + 3601.0)


@pytest.mark.parametrize(("turn_deg", "moved"), [(0.75, False), (0.85, True), (30.0, True)])
def test_a_measured_attitude_moves_the_satellite_s_beam_from_a_fiftieth_of_it(turn_deg: float, moved: bool) -> None:
    one = Bench(SourceParams(antenna=SatelliteAntennaParams(half_power_beamwidth_rad=math.radians(40.0))))
    half = math.radians(0.5 * turn_deg)
    one.target.take_attitude((math.sin(half), 0.0, 0.0, math.cos(half)))
    one.target.renew(NOW_S)
    assert one.target.track.antenna.roll_rad == pytest.approx(2.0 * half if moved else 0.0, abs=1e-9)
    assert (len(one.lists), len(one.profiles)) == (1, 1 + moved)
    profile = one.profiles[-1][0]
    row = len(profile.t_s) // 2
    gain_db = one.target.track.target_at(profile.t_s[row]).satellite_gain_db
    assert profile.satellite_gain_db[row] == pytest.approx(gain_db, abs=1e-9)


# Newer elements


def tle_text(ahead_s: float = 0.0) -> str:
    return "\n".join(("CBERS 2", *tle_lines(dataclasses.replace(CBERS, epoch_t_s=CBERS.epoch_t_s - ahead_s)))) + "\n"


def test_replaced_elements_come_into_force_between_passes_and_a_broken_file_is_tried_once(tmp_path: Path) -> None:
    file = tmp_path / "cbers.tle"
    file.write_text(tle_text())
    one = Bench(SourceParams(elements=str(file)))
    first, second = one.target.passes[:2]
    assert one.target.renew(one.between_s()) == ("", False)
    file.write_text(tle_text(ahead_s=30.0))
    one.set(hold=True)
    # 10 s are needed before targets are published, 7 s ahead of the pass.
    for now_s in (first.tca_t_s, second.aos_t_s - 16.9):
        assert one.target.renew(now_s) == ("", False)
    assert one.target.renew(one.between_s()) == ("", False), "a target that is held keeps its elements"
    one.set(hold=False)
    assert one.target.renew(second.aos_t_s - 18.0) == ("newer elements of CBERS 2 are in force", False)
    assert one.target.passes[0].aos_t_s == pytest.approx(second.aos_t_s - 30.0, abs=3.0)
    present = one.target.passes
    file.write_text(tle_text()[:-20])
    news, bad = one.target.renew(one.between_s())
    assert (bad, one.target.passes) == (True, present)
    assert news.startswith("elements were not renewed: cbers.tle: line")
    assert news in one.problem()
    assert one.target.renew(one.between_s()) == ("", False)
    file.write_text(tle_text())
    assert one.target.renew(one.between_s())[0] == "newer elements of CBERS 2 are in force"
    assert one.problem() == ""
