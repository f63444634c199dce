"""Times along the orbit that passes teach: planted errors recovered, grown by the law, dropped where they do not hold."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import MDEG, HeldDirection, random_stream
from rf_pointing.ephemeris import Elements, ElementUncertainty, Site, TopocentricTrack
from rf_pointing.ephemeris.learned_times import LearnedTime, LearnedTimes, fitted_time

TCA_T_S = 1151384680.3
LAW, BEAM_RAD = ElementUncertainty(), 300.0 * MDEG
KNOWN = LearnedTime(
    epoch_t_s=1151347924.079712, t_s=TCA_T_S, along_s=2.0, rate=1e-6, variances=(0.04, 1e-9, 1e-12), growth_1_s=4e-12
)


def held(track: TopocentricTrack, ahead_s: float, sigma_rad: float = 10.0 * MDEG, bias_rad: float = 20.0 * MDEG,
         about_s: float = TCA_T_S) -> list[HeldDirection]:  # fmt: skip
    """Directions in which a satellite so far ahead was held, with slow noise and the mount's bias."""
    times = about_s + np.arange(-250.0, 250.0)
    looks = track.with_offsets(along_track_offset_s=ahead_s).sample(times)
    noise = np.repeat(random_stream(7, f"held {ahead_s}").standard_normal((2, 50)), 10, axis=1) * sigma_rad
    azimuth = looks.azimuth_rad + (noise[0] + bias_rad) / np.cos(looks.elevation_rad)
    rows = zip(times.tolist(), azimuth.tolist(), (looks.elevation_rad + noise[1] - bias_rad).tolist(), strict=True)
    return [HeldDirection(t_s=t, azimuth_rad=az, elevation_rad=el, beamwidth_rad=BEAM_RAD) for t, az, el in rows]


EXACT = ElementUncertainty(along_m=0.0, along_growth_m_s=0.0, along_drag_m_s2=0.0)


def taught(times: LearnedTimes, track: TopocentricTrack, ahead_s: float, about_s: float = TCA_T_S,
           law: ElementUncertainty = LAW) -> str:  # fmt: skip
    for each in held(track, ahead_s, about_s=about_s):
        times.take(each)
    return times.end_pass(track, law)


@pytest.mark.parametrize("ahead_s", [-7.0, -1.0, 0.05, 4.0, 14.0])
def test_the_planted_time_is_recovered_within_its_sigma(track: TopocentricTrack, ahead_s: float) -> None:
    found_s, sigma_s = fitted_time(track, held(track, ahead_s))
    assert abs(found_s - ahead_s) < 3.0 * sigma_s
    assert sigma_s < 0.1


@given(later_s=st.floats(0.0, 1e6), along_s=st.floats(-5.0, 5.0), sigma_s=st.floats(0.01, 5.0))
def test_time_makes_what_was_learned_less_certain_and_a_pass_more(
    later_s: float, along_s: float, sigma_s: float
) -> None:
    """The closed form of the growth; the information of a pass adds to that of those before."""
    t_s = KNOWN.t_s + later_s
    grown = math.sqrt(0.04 + 2e-9 * later_s + 1e-12 * later_s**2 + (4e-12 * later_s**2) ** 2)
    assert KNOWN.sigma_s(t_s) == pytest.approx(grown)
    assert KNOWN.ahead_s(t_s) == pytest.approx(2.0 + 1e-6 * later_s)
    after = KNOWN.fused(t_s, along_s, sigma_s)
    assert after.sigma_s(t_s) ** -2 == pytest.approx(grown**-2 + sigma_s**-2, rel=1e-6)
    weighted_s = (KNOWN.ahead_s(t_s) / grown**2 + along_s / sigma_s**2) * after.sigma_s(t_s) ** 2
    assert after.ahead_s(t_s) == pytest.approx(weighted_s, abs=1e-6)
    assert after.passes == KNOWN.passes + 1


def test_a_pass_teaches_the_next_one_also_after_a_restart(track: TopocentricTrack, tmp_path: Path) -> None:
    times = LearnedTimes(str(tmp_path / "learned.json"))
    assert "from 1 pass" in taught(times, track, 1.5)
    again = LearnedTimes(str(tmp_path / "learned.json"))
    led = again.applied(track, TCA_T_S + 6000.0, LAW)
    assert led.learned is not None
    assert led.learned.ahead_s(TCA_T_S + 6000.0) == pytest.approx(1.5, abs=0.2)
    there = led.target_at(TCA_T_S)
    true = track.with_offsets(along_track_offset_s=1.5).target_at(TCA_T_S)
    assert there.elevation_rad == pytest.approx(true.elevation_rad, abs=0.2 * 0.01)
    assert "from 2 passes" in taught(again, track, 1.5, about_s=TCA_T_S + 3.0)
    assert again.forget(track.name).endswith("forgotten on request")
    assert again.applied(led, TCA_T_S, LAW).learned is None
    with pytest.raises(ValueError, match=f"nothing was learned of {track.name}"):
        again.forget(track.name)


def test_a_pass_teaches_also_against_a_law_without_errors(track: TopocentricTrack) -> None:
    assert "from 1 pass" in taught(LearnedTimes(""), track, 1.5, law=EXACT)


def test_too_short_a_pass_teaches_nothing(track: TopocentricTrack) -> None:
    times = LearnedTimes("")
    for each in held(track, 1.0)[:59]:
        times.take(each)
    assert times.end_pass(track, LAW) == ""


@pytest.mark.parametrize(
    ("cause", "reason"),
    [
        ("elements", "newer elements are in force"),
        ("age", r"after 2\d\d\.\d h its sigma is \d+\.\d+ s, that of the elements"),
        ("manoeuvre", r"this pass is -3\.\d\d s off it, sigma 0\.\d\d s: a manoeuvre"),
    ],
)
def test_what_no_longer_holds_is_dropped_and_said(
    cause: str, reason: str, cbers: Elements, goldstone: Site, track: TopocentricTrack
) -> None:
    times, later_s = LearnedTimes(""), TCA_T_S + 60.0
    taught(times, track, 1.5)
    if cause == "elements":
        newer = TopocentricTrack(replace(cbers, epoch_t_s=cbers.epoch_t_s + 5000.0), goldstone)
        assert times.applied(newer, later_s, LAW).learned is None
    elif cause == "age":
        # A law that hardly grows: the rate of the one pass is soon known worse.
        young = LAW.replace(along_growth_m_s=0.0, along_drag_m_s2=0.0)
        assert times.of(track, TCA_T_S + 9.0 * 86400.0, young) is None
    else:
        words = taught(times, track, -2.0, about_s=later_s)
        assert words.startswith(f"{track.name} is -")
    assert re.search(reason, times.news), times.news


@pytest.mark.parametrize(
    "values",
    [{"along_s": 1e3}, {"variances": [-1.0, 0.0, 1.0]}, {"variances": [1.0, 2.0, 1.0]}, {"rate": "fast"}, {"variances": [1]},
     {"epoch_t_s": None}],
)  # fmt: skip
def test_a_file_that_cannot_be_is_refused(values: dict[str, object], tmp_path: Path) -> None:
    good = {"epoch_t_s": 1.0, "t_s": 2.0, "along_s": 0.1, "rate": 0.0, "variances": [1.0, 0.0, 1.0], "growth_1_s": 0.0}
    file = tmp_path / "learned.json"
    file.write_text(json.dumps({"BIRD": good | values}))
    with pytest.raises(ValueError, match="cannot be used"):
        LearnedTimes(str(file))
    file.write_text(json.dumps({"BIRD": good}))
    LearnedTimes(str(file))
