"""The Sun that drifts into the beam of an antenna at rest, and the permission that lets it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.core import JointTrajectory, leaves, parse_utc, utc_text
from rf_pointing.ephemeris import SITES
from rf_pointing.ephemeris.solar import LONGEST_PERMIT_S, SolarDirection, SunParams, SunPermit
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.simulation import StationSetup
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna
from rf_pointing.station.antenna.sun_at_rest import SunAtRestParams, sun_entry

RADIUS_RAD = math.radians(1.0)
MORNING_S = parse_utc("2026-06-21T08:00:00Z")
TICK_S = 0.02
Rows = list[tuple[float, str, float]]
WIND_RAD = math.radians(0.05)
"""What the wind moves an antenna at rest."""


def antenna_before(seconds: float, **safety: object) -> tuple[SimulatedAntenna, float]:
    """Return an antenna at rest where the Sun will be in `seconds`, and the time now."""
    params = AntennaParams(**StationSetup("leo_3m7").sets("antenna_servo"))
    there = SolarDirection(params.safety.sun).at(MORNING_S)
    assert there is not None
    params = params.replace(
        antenna=params.antenna.replace(start_azimuth_rad=there[0], start_elevation_rad=there[1]),
        safety=params.safety.replace(**safety),
    )
    made = SimulatedAntenna(params)
    made.enable()
    return made, MORNING_S - seconds


def run(antenna: SimulatedAntenna, begin_s: float, seconds: float) -> Rows:
    """Return per second the time, what is said of the Sun, and how far it is from the axes."""
    sun, rows = SolarDirection(antenna.safety.params.sun), []
    for tick in range(1, round(seconds / TICK_S) + 1):
        t_s = round(begin_s + tick * TICK_S, 6)
        antenna.step(t_s)
        if tick % 50 == 0:
            here, there = antenna.axes.encoder_rad.tolist(), sun.at(t_s)
            rows.append((t_s, antenna.status(t_s).sun, ForbiddenSky.sun_distance(*here, there)))
    return rows


@pytest.mark.parametrize("site", ["Goldstone DSS-13", "Canberra"])
@pytest.mark.parametrize("off_deg", [-0.9, 0.0, 0.6, 1.2])
def test_the_entry_is_when_a_look_each_second_first_finds_the_sun(site: str, off_deg: float) -> None:
    place = next(each for name, each in SITES.items() if name.startswith(site))
    begin_s = parse_utc("2026-06-21T20:00:00Z")
    sun, oracle = (SolarDirection(SunParams(site=place)) for _ in range(2))
    there = oracle.at(begin_s + 500.0)
    assert there is not None
    direction = (there[0], there[1] + math.radians(off_deg))
    looks = {t: SolarDirection(SunParams(site=place)).at(begin_s + t) for t in range(600)}
    apart = ForbiddenSky.sun_distance
    inside = [t for t, seen in looks.items() if apart(*direction, seen) < RADIUS_RAD]
    params = SunAtRestParams(warning_s=600.0)
    entry = sun_entry(sun, RADIUS_RAD, params, direction, begin_s)
    assert (entry is None) == (not inside)
    if entry is not None:
        assert entry.t_s - begin_s == pytest.approx(inside[0], abs=2.0)
        assert sun_entry(sun, RADIUS_RAD, params, direction, entry.t_s - 601.0) is None
        assert sun_entry(sun, RADIUS_RAD, params, direction, entry.t_s - 599.0) is not None
    assert sun_entry(sun, 0.0, params, direction, begin_s) is None


@pytest.mark.parametrize("rest", [None, AntennaMode.PARKED, AntennaMode.STOWED])
def test_an_antenna_at_rest_warns_five_minutes_ahead_and_turns_to_where_the_sun_does_not_come(
    rest: AntennaMode | None,
) -> None:
    # The Sun's centre comes to its zone's edge about 4 min before it is in the middle.
    antenna, begin_s = antenna_before(700.0)
    if rest is not None:
        antenna.rest(rest)
    here = antenna.axes.encoder_rad.copy()
    before = run(antenna, begin_s, 120.0)
    assert all(text == "" for _, text, _ in before), "more than 5 min ahead"
    rows = run(antenna, begin_s + 120.0, 400.0)
    warned_s = next(t_s for t_s, text, _ in rows if text)
    text = next(text for _, text, _ in rows if text)
    entry = next(t_s for t_s, text, _ in rows if text.endswith("it turns away"))
    assert entry - warned_s == pytest.approx(240.0, abs=3.0)
    assert utc_text(warned_s + 300.0)[:16] in text
    assert "must be >= 1.000 deg (sun.radius_deg)" in text
    waiting = [text for t_s, text, _ in rows if warned_s <= t_s < entry]
    assert len(set(waiting)) <= 3, "the same words while it comes"
    assert min(apart for *_, apart in rows) > RADIUS_RAD
    assert antenna.mode == (AntennaMode.HOLDING if rest is None else AntennaMode.PARKED)
    moved = antenna.axes.encoder_rad - here
    assert math.hypot(moved[0] * math.cos(here[1]), moved[1]) < math.radians(4.0)
    # There it stays for half an hour.
    sun = SolarDirection(antenna.safety.params.sun)
    later = [sun.at(antenna.t_s + 60.0 * minute) for minute in range(29)]
    there, apart = antenna.axes.encoder_rad.tolist(), ForbiddenSky.sun_distance
    assert min(apart(*there, each) for each in later) > RADIUS_RAD
    assert antenna.safety.latch.text == ""


@pytest.mark.parametrize(
    ("change", "mode"),
    [
        (lambda a: a.rest(AntennaMode.DISABLED), "disabled"), (lambda a: a.trip("a fault"), "in fault"),
        (lambda _: None, "holding"),
    ],
)  # fmt: skip
def test_what_must_not_move_only_warns(change, mode: str) -> None:
    only_warns = {"at_rest": SunAtRestParams(escapes=False)} if mode == "holding" else {}
    antenna, begin_s = antenna_before(200.0, **only_warns)
    change(antenna)
    here = antenna.axes.encoder_rad.copy()
    assert f"the antenna stays (the antenna is {mode})" in run(antenna, begin_s, 20.0)[-1][1]
    assert antenna.axes.encoder_rad == pytest.approx(here, abs=WIND_RAD)


def test_commands_that_stand_in_the_suns_path_do_not_hold_the_antenna_there() -> None:
    antenna, begin_s = antenna_before(300.0)
    sun, apart = SolarDirection(antenna.safety.params.sun), ForbiddenSky.sun_distance
    here, nearest = antenna.axes.encoder_rad.copy(), math.inf
    for tick in range(1, 400 * 50):
        t_s = round(begin_s + tick * TICK_S, 6)
        antenna.step(t_s)
        if tick % 5 == 0:
            ahead = t_s + np.arange(0.1, 1.05, 0.1)
            rows = np.tile(here, (len(ahead), 1))
            still = {"velocity_rad_s": 0.0 * rows, "acceleration_rad_s2": 0.0 * rows}
            antenna.accept(JointTrajectory(t_s=ahead, position_rad=rows, **still), t_s, "a")
        if tick % 50 == 0:
            nearest = min(nearest, apart(*antenna.axes.encoder_rad.tolist(), sun.at(t_s)))
    assert nearest > RADIUS_RAD - math.radians(0.05), "found within a second of the entry"
    assert "from the Sun, must be >=" in antenna.status(t_s).last_rejection


# The permission


def permit_until(t_s: float, **changes: object) -> SunPermit:
    return replace(SunPermit(by="alice", until_t_s=t_s, band="X"), **changes)


def test_a_permission_is_for_the_receiver_alone_and_ends_by_itself() -> None:
    antenna, begin_s = antenna_before(60.0)
    antenna.t_s = begin_s
    here = tuple(antenna.axes.encoder_rad.tolist())
    assert antenna.permit_sun(permit_until(begin_s + 100.0), "X") == ""
    rows = run(antenna, begin_s, 90.0)
    assert min(apart for *_, apart in rows) < RADIUS_RAD
    assert antenna.go_to(here) == ""
    status = antenna.status(begin_s + 90.0)
    assert (status.mode, status.sun_permit, status.sun_permit_band) == ("holding", "alice", "X")
    assert status.sun_permit_until_t_s == begin_s + 100.0
    assert "from the Sun, must be >= 1.000 deg" in status.transmit_inhibit
    # It ends by itself, and the antenna leaves.
    rows = run(antenna, begin_s + 90.0, 40.0)
    assert rows[-1][2] > RADIUS_RAD
    status = antenna.status(antenna.t_s)
    assert (status.sun_permit, status.sun_permit_until_t_s) == ("", 0.0)
    assert "from the Sun" in antenna.go_to(here)


@pytest.mark.parametrize(
    ("permit", "words"),
    [
        (permit_until(MORNING_S - 1.0), "07:59:59.000Z is -1 s ahead, must be > 0"),
        (permit_until(MORNING_S + LONGEST_PERMIT_S + 1.0), "43201 s ahead, must be > 0 and <= 43200"),
        (permit_until(MORNING_S + 60.0, band="S"), "band='S' must be 'X', the band in use"),
        (permit_until(MORNING_S + 60.0, by=" "), "must name who permits it"),
        (permit_until(MORNING_S + 60.0, by="a\nb"), "must be one line"),
    ],
)
def test_a_permission_names_who_until_when_and_which_band(permit: SunPermit, words: str) -> None:
    antenna, _ = antenna_before(0.0)
    antenna.t_s = MORNING_S
    assert words in antenna.permit_sun(permit, "X")
    assert antenna.safety.sun.permitted(MORNING_S) is None


def test_no_parameter_gives_a_permission() -> None:
    assert not [name for name in leaves(AntennaParams()) if "permit" in name]
