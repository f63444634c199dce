"""OEM: closed-form polynomials and orbits, skyfield's frames, the edges of the usable span, and malformed messages.

OEM as stations receive it: what is refused, with its line, and which oddities change nothing.
"""

import math

import numpy as np
import pytest
from skyfield.api import EarthSatellite, load
from skyfield.framelib import itrs

from rf_pointing.core import MDEG, angular_distance_rad, random_stream
from rf_pointing.core.dates import from_utc_text, utc_text
from rf_pointing.ephemeris import (
    Elements,
    OemTarget,
    Site,
    TopocentricTrack,
    find_passes,
    oem_text,
    orientation_sigma_rad,
    sun,
)
from rf_pointing.ephemeris.oem import StateCovariance, tai_from_text
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from test.ephemeris.conftest import AssumedOrientation
from test.ephemeris.oem_text import START_T_S, STEP_S, TIMES, read_oem, teme_states, text_of
from test.ephemeris.test_track import tle_lines

INSIDE = np.linspace(TIMES[0], TIMES[-1], 333)
LAGRANGE = {"INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "9"}
FRAME_MDEG = {"TEME": 1e-3, "ITRF-2014": 1e-3, "GCRF": 2e-3, "EME2000": 2e-3}
"""Against skyfield's own precession, nutation and sidereal time; EME2000 states are rotated by the published bias."""


def cubic(t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A cubic in time, in km, and its velocity: any method of degree 3 or more must reproduce it exactly."""
    u = np.asarray(t_s - START_T_S)[..., None] / 400.0
    coefficients = np.array([[7000.0, 10.0, -3000.0], [200.0, 2500.0, 300.0], [-90.0, 35.0, 8.0], [3.0, -4.0, 5.0]])
    position = sum(c * u**k for k, c in enumerate(coefficients))
    velocity = sum(k * c * u ** (k - 1) for k, c in enumerate(coefficients) if k) / 400.0
    return position, velocity


@pytest.mark.parametrize(("method", "degree"), [("HERMITE", 3), ("HERMITE", 11), ("LAGRANGE", 3), ("LAGRANGE", 10)])
def test_a_cubic_motion_comes_back_with_all_its_derivatives(method: str, degree: int) -> None:
    position, velocity = cubic(TIMES)
    text = text_of(
        list(np.hstack([position, velocity])), REF_FRAME="ITRF-2020", INTERPOLATION=method,
        INTERPOLATION_DEGREE=str(degree),
    )  # fmt: skip
    target = OemTarget(read_oem(text))
    turning = np.array([0.0, 0.0, target.rotation_rate_rad_s])
    motion = target.motion_at(INSIDE)
    wanted, wanted_velocity = (1e3 * v for v in cubic(INSIDE))
    np.testing.assert_allclose(np.transpose(motion.position), wanted, rtol=0.0, atol=1e-3)
    inertial = wanted_velocity + np.cross(turning, wanted)
    np.testing.assert_allclose(np.transpose(motion.velocity), inertial, rtol=0.0, atol=1e-3)
    # Z = z exp(i w t): its n-th derivative at the time itself is (D + i w)^n z.
    w = target.rotation_rate_rad_s
    u = (INSIDE - START_T_S)[:, None] / 400.0
    second = (2.0 * np.array([-90.0, 35.0, 8.0]) + 6.0 * u * np.array([3.0, -4.0, 5.0])) * 1e3 / 400.0**2
    third = np.broadcast_to(6.0 * np.array([3.0, -4.0, 5.0]) * 1e3 / 400.0**3, second.shape)
    z, z1, z2, z3 = (part[:, 0] + 1j * part[:, 1] for part in (wanted, wanted_velocity, second, third))
    acceleration = z2 + 2j * w * z1 - w**2 * z
    jerk = z3 + 3j * w * z2 - 3.0 * w**2 * z1 - 1j * w**3 * z
    for found, turned, up, tolerance in (
        (motion.acceleration, acceleration, second[:, 2], 1e-6), (motion.jerk, jerk, third[:, 2], 1e-7),
    ):  # fmt: skip
        np.testing.assert_allclose(found[0] + 1j * found[1], turned, rtol=0.0, atol=tolerance)
        np.testing.assert_allclose(found[2], up, rtol=0.0, atol=tolerance)


def test_linear_interpolation_is_the_chord() -> None:
    position, velocity = cubic(TIMES)
    text = text_of(
        list(np.hstack([position, velocity])), REF_FRAME="ITRF", INTERPOLATION="LINEAR", INTERPOLATION_DEGREE=""
    )
    middle = OemTarget(read_oem(text)).motion_at(float(TIMES[4] + 0.25 * STEP_S)).position
    np.testing.assert_allclose(middle, 1e3 * (0.75 * position[4] + 0.25 * position[5]), rtol=0.0, atol=1e-3)


@pytest.mark.parametrize(("method", "degree", "tolerance_mdeg"), [("HERMITE", "7", 2e-3), ("LAGRANGE", "9", 2e-3)])
def test_an_oem_of_a_pass_points_where_its_elements_point(
    cbers: Elements, goldstone: Site, method: str, degree: str, tolerance_mdeg: float
) -> None:
    target = OemTarget(read_oem(text_of(teme_states(cbers), INTERPOLATION=method, INTERPOLATION_DEGREE=degree)))
    ours, wanted = TopocentricTrack(target, goldstone).sample(INSIDE), TopocentricTrack(cbers, goldstone).sample(INSIDE)
    apart = angular_distance_rad(ours.azimuth_rad, ours.elevation_rad, wanted.azimuth_rad, wanted.elevation_rad)
    assert apart.max() < tolerance_mdeg * MDEG
    np.testing.assert_allclose(ours.azimuth_rate_rad_s, wanted.azimuth_rate_rad_s, rtol=0.0, atol=1e-3 * MDEG)
    np.testing.assert_allclose(
        ours.elevation_acceleration_rad_s2, wanted.elevation_acceleration_rad_s2, rtol=0.0, atol=5e-3 * MDEG
    )


@pytest.mark.parametrize("frame", FRAME_MDEG)
def test_every_frame_points_to_the_same_satellite(frame: str, cbers: Elements, goldstone: Site) -> None:
    """States from skyfield in its own frames, without polar motion on either side."""
    scale = load.timescale(builtin=True)
    at = EarthSatellite(*tle_lines("28057"), "x", scale).at(scale.utc(1970, 1, 1 + TIMES // 86400, 0, 0, TIMES % 86400))
    if frame == "TEME":
        states = teme_states(cbers)
    elif frame.startswith("ITRF"):
        position, velocity = at.frame_xyz_and_velocity(itrs)
        states = list(np.vstack([position.km, velocity.km_per_s]).T)
    else:
        bias = np.array([[1.0, -7.0783e-8, 8.0562e-8], [7.0783e-8, 1.0, 3.306e-8], [-8.0562e-8, -3.306e-8, 1.0]])
        turn = bias if frame == "EME2000" else np.eye(3)
        states = list(np.vstack([turn @ at.position.km, turn @ at.velocity.km_per_s]).T)
    as_skyfield = AssumedOrientation(ut1_minus_utc_s=float(at.t.dut1.mean()))
    target = OemTarget(read_oem(text_of(states, REF_FRAME=frame, **LAGRANGE)), as_skyfield)
    ours = TopocentricTrack(target, goldstone).sample(INSIDE)
    wanted = TopocentricTrack(cbers, goldstone, orientation=as_skyfield).sample(INSIDE)
    apart = angular_distance_rad(ours.azimuth_rad, ours.elevation_rad, wanted.azimuth_rad, wanted.elevation_rad)
    assert apart.max() < FRAME_MDEG[frame] * MDEG
    np.testing.assert_allclose(ours.range_rate_m_s, wanted.range_rate_m_s, rtol=0.0, atol=0.05)


def test_one_time_and_many_times_agree(cbers: Elements, goldstone: Site) -> None:
    track = TopocentricTrack(OemTarget(read_oem(text_of(teme_states(cbers)))), goldstone)
    looks = track.sample(INSIDE[::50])
    for index, t_s in enumerate(INSIDE[::50].tolist()):
        assert track.target_at(t_s).elevation_rad == pytest.approx(looks.elevation_rad[index], abs=1e-12)


@pytest.mark.parametrize(("scale", "offset_s"), [("TAI", 33.0), ("TT", 65.184), ("GPS", 14.0), ("TDB", 65.184)])
def test_time_systems_are_told_apart(scale: str, offset_s: float, cbers: Elements) -> None:
    """The same instants written in another scale: 33 s of leap seconds in 2006."""
    shifted = text_of(teme_states(cbers), times=TIMES + offset_s, TIME_SYSTEM=scale)
    plain = OemTarget(read_oem(text_of(teme_states(cbers))))
    other = OemTarget(read_oem(shifted))
    error_s = 0.002 if scale == "TDB" else 1e-6
    apart = np.subtract(
        other.motion_at(float(TIMES[5]) + 0.1).position, plain.motion_at(float(TIMES[5]) + 0.1).position
    )
    assert np.linalg.norm(apart) < 7600.0 * error_s + 0.01


def test_nothing_is_extrapolated_beyond_the_usable_span(cbers: Elements) -> None:
    usable = {"USEABLE_START_TIME": utc_text(TIMES[2]), "USEABLE_STOP_TIME": utc_text(TIMES[-3])}
    target = OemTarget(read_oem(text_of(teme_states(cbers), **usable)))
    for t_s in (float(TIMES[2]), float(TIMES[-3])):
        target.motion_at(t_s)
    for t_s in (float(TIMES[2]) - 0.01, float(TIMES[-3]) + 0.01):
        with pytest.raises(ValueError, match=r"outside the usable span of CBERS 2: 2006-06-27T05:00:20.* to 2006"):
            target.motion_at(t_s)
        with pytest.raises(ValueError, match="outside the usable span"):
            target.motion_at(np.array([TIMES[5], t_s]))


def test_segments_are_not_interpolated_across_and_the_later_one_wins(cbers: Elements) -> None:
    """The second segment, as after a manoeuvre, is moved by 100 km and begins inside the first."""
    states = teme_states(cbers)
    moved = [state + np.array([100.0, 0, 0, 0, 0, 0]) for state in states]
    first = text_of(states[:9], times=TIMES[:9])
    second = "META_START" + text_of(moved[7:], times=TIMES[7:]).split("META_START", 1)[1]
    target, plain = OemTarget(read_oem(first + second)), OemTarget(read_oem(text_of(states)))
    for t_s, shift_m in ((float(TIMES[7]) - 0.1, 0.0), (float(TIMES[7]) + 0.1, 1e5), (float(TIMES[-1]), 1e5)):
        apart = np.subtract(target.motion_at(t_s).position, plain.motion_at(t_s).position)
        assert np.linalg.norm(apart) == pytest.approx(shift_m, abs=1.0)


GAP = slice(6, 9)
"""States that are missing between two segments of the same object."""


def two_parts(cbers: Elements) -> OemTarget:
    states = teme_states(cbers)
    first = text_of(states[: GAP.start], times=TIMES[: GAP.start])
    second = "META_START" + text_of(states[GAP.stop :], times=TIMES[GAP.stop :]).split("META_START", 1)[1]
    return OemTarget(read_oem(first + second))


def test_passes_are_looked_for_on_both_sides_of_a_gap(cbers: Elements, goldstone: Site) -> None:
    parts = find_passes(TopocentricTrack(two_parts(cbers), goldstone), TIMES[0] - 3600.0, 7200.0, math.radians(5.0))
    (whole,) = find_passes(TopocentricTrack(cbers, goldstone), TIMES[0] - 3600.0, 7200.0, math.radians(5.0))
    assert [(p.rises_before, p.sets_after) for p in parts] == [(False, True), (True, False)]
    ends = [parts[0].aos_t_s, parts[0].los_t_s, parts[1].aos_t_s, parts[1].los_t_s]
    gap = (TIMES[GAP.start - 1] - 1.0, TIMES[GAP.stop] + 1.0)
    assert ends == pytest.approx([whole.aos_t_s, *gap, whole.los_t_s], abs=1e-3)


@pytest.mark.parametrize("ahead_s", [-40.0, 40.0])
def test_an_along_track_offset_moves_the_times_at_which_an_ephemeris_is_known(
    ahead_s: float, cbers: Elements, goldstone: Site
) -> None:
    track = TopocentricTrack(OemTarget(read_oem(text_of(teme_states(cbers)))), goldstone, along_track_offset_s=ahead_s)
    ((first, last),) = track.spans_t_s
    assert (first, last) == pytest.approx((TIMES[0] + 1.0 - ahead_s, TIMES[-1] - 1.0 - ahead_s), abs=1e-6)
    for t_s in (first, last):
        assert track.covers(t_s)
        track.target_at(t_s)
    assert not track.covers(first - 0.1)
    assert not track.covers(last + 0.1)
    (found,) = find_passes(track, TIMES[0] - 3600.0, 7200.0, math.radians(5.0))
    assert first <= found.aos_t_s < found.los_t_s <= last
    held = track.with_offsets(along_track_offset_s=ahead_s, cross_track_offset_rad=0.0, hold_t_s=first)
    assert held.covers(last + 3600.0)
    assert held.target_at(last + 3600.0).elevation_rad == track.target_at(first).elevation_rad


@pytest.mark.parametrize(
    ("meta", "message"),
    [
        ({"CENTER_NAME": "MOON"}, "CENTER_NAME='MOON' must be EARTH"),
        ({"TIME_SYSTEM": "MET"}, "TIME_SYSTEM='MET' must be one of UTC, TAI"),
        ({"REF_FRAME": "TOD"}, "REF_FRAME='TOD' must be one of GCRF"),
        ({"INTERPOLATION": "SPLINE"}, "INTERPOLATION='SPLINE' must be one of HERMITE, LAGRANGE, LINEAR"),
        ({"INTERPOLATION_DEGREE": "many"}, "INTERPOLATION_DEGREE='many' must be a whole number"),
        ({"INTERPOLATION_DEGREE": "6"}, "INTERPOLATION_DEGREE=6 must be odd, 3 or more, for HERMITE"),
        ({"INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "15"}, "has 15 states, must have 16 for LAGRANGE"),
        ({"INTERPOLATION_DEGREE": "1"}, r"INTERPOLATION_DEGREE='1' must be a whole number in \[3, 15\] for HERMITE"),
        (
            {"USEABLE_START_TIME": "2006-06-27T05:11:00", "USEABLE_STOP_TIME": "2006-06-27T05:01:00"},
            "USEABLE_START_TIME=2006-06-27T05:11:00 must be before USEABLE_STOP_TIME=2006-06-27T05:01:00",
        ),
        ({"OBJECT_ID": "", "STOP_TIME": ""}, "CBERS 2 lacks OBJECT_ID, STOP_TIME"),
    ],
)
def test_bad_metadata_is_named(meta: dict[str, str], message: str, cbers: Elements) -> None:
    with pytest.raises(ValueError, match=message):
        OemTarget(read_oem(text_of(teme_states(cbers), **meta)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("CCSDS_OEM_VERS", "CCSDS_OMM_VERS"), "line 3: .META_START. must read KEYWORD = value"),
        (("META_START", "META_BEGIN"), "line 3: 'META_BEGIN' must read KEYWORD = value"),
        (("2006-06-27T05:00:20.000 ", "2006-06-27T05:00:20.000 7 "), "line 17: a state must have an epoch and 6 or 9"),
        (("2006-06-27T05:00:20.000 ", "2006-06-27T05:00:20.000 x"), "line 17: .* is not a number"),
        (("2006-06-27T05:00:20.000 ", "2006-06-27T04:00:20.000 "), "line 17: 2006-06-27T04:00:20.000 must be later"),
        (
            ("2006-06-27T05:00:20.000 ", "2006-06-27T04:59:60.000 "),
            "line 17: .* has second 60, must be < 60 in that minute",
        ),
        (("TIME_SYSTEM = UTC", "TIME_SYSTEM = UTC\nTIME_SYSTEM = TAI"), "line 9: TIME_SYSTEM is given twice"),
    ],
)
def test_malformed_text_is_refused_with_its_line(change: tuple[str, str], message: str, cbers: Elements) -> None:
    text = text_of(teme_states(cbers))
    assert change[0] in text
    with pytest.raises(ValueError, match=message):
        read_oem(text.replace(*change))


def test_a_message_that_ends_too_early_is_refused_and_one_that_ends_a_step_early_is_not(cbers: Elements) -> None:
    lines = text_of(teme_states(cbers)).splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("2006"))
    assert OemTarget(read_oem("\n".join(lines[: first + 14]))).spans_t_s[0][1] == pytest.approx(TIMES[13] - 1.0)
    with pytest.raises(ValueError, match=r"STOP_TIME=.* lies 240 s beyond the states, must be <= 60 s .*whole"):
        read_oem("\n".join(lines[: first + 11]))


@pytest.mark.parametrize(
    ("factors", "message"),
    [
        ((1e3, 1e3), r"line 15: distance 7.*e\+06 km .* must be in \[5740, 3000000\] km"),
        ((1.0, 1e3), r"line 15: speed 74\d\d.* km/s must be <= 3\d\.\d+ km/s there"),
        ((1.0, 60.0), "line 15: speed 44"),
        ((1e-3, 1e-3), r"line 15: distance 7\.1"),
    ],
)
def test_states_in_other_units_than_km_are_refused(factors: tuple[float, float], message: str, cbers: Elements) -> None:
    states = [state * np.repeat(factors, 3) for state in teme_states(cbers)]
    with pytest.raises(ValueError, match=message):
        read_oem(text_of(states))


def test_states_inside_a_leap_second_are_read() -> None:
    """Half a second steps over the end of 2016 are even in TAI."""
    epochs = ("2016-12-31T23:59:59.5", "2016-12-31T23:59:60.0", "2016-12-31T23:59:60.5", "2017-01-01T00:00:00.0")
    meta = {
        "OBJECT_NAME": "X", "OBJECT_ID": "X", "CENTER_NAME": "EARTH", "REF_FRAME": "ITRF", "TIME_SYSTEM": "UTC",
        "START_TIME": epochs[0], "STOP_TIME": epochs[-1], "INTERPOLATION": "LINEAR",
    }  # fmt: skip
    rows = [f"{epoch} {7000.0 + 3.5 * step} 0 0 7.0 0 0" for step, epoch in enumerate(epochs)]
    lines = [
        "CCSDS_OEM_VERS = 2.0", "META_START", *(f"{key} = {value}" for key, value in meta.items()),
        "META_STOP", *rows,
    ]  # fmt: skip
    (segment,) = read_oem("\n".join(lines))
    np.testing.assert_allclose(np.diff(segment.tai_s), 0.5, atol=1e-6)
    with pytest.raises(ValueError, match="line 13: .* has second 60, must be < 60"):
        read_oem("\n".join(lines).replace("TIME_SYSTEM = UTC", "TIME_SYSTEM = TAI"))


def test_a_written_message_is_read_back_as_the_orbit_that_it_was_written_from() -> None:
    track = load_track(SourceParams(satellite="28057"))
    start_s = load_elements(SourceParams(satellite="28057")).epoch_t_s
    text = oem_text(track.target, "2003-049A", start_s, start_s + 7200.0, originator="rf_pointing", created_t_s=start_s)
    (segment,) = read_oem(text)
    assert (segment.name, segment.object_id, segment.frame) == (track.name, "2003-049A", "ITRF-2020")
    back = TopocentricTrack(OemTarget([segment]), track.site)
    # Between the states, where the interpolation errs most.
    times = start_s + 1530.0 + 60.0 * np.arange(90)
    there, here = back.sample(times), track.sample(times)
    apart = angular_distance_rad(there.azimuth_rad, there.elevation_rad, here.azimuth_rad, here.elevation_rad)
    print(f"{np.degrees(apart.max()) * 1e3:.2g} mdeg, {np.max(np.abs(there.range_m - here.range_m)):.2g} m")
    assert np.degrees(apart.max()) < 1e-6
    assert np.max(np.abs(there.range_m - here.range_m)) < 0.05


def test_a_body_of_the_sky_has_no_ephemeris_message() -> None:
    with pytest.raises(ValueError, match="Sun is not a satellite: an OEM holds the states of an orbit"):
        oem_text(sun(), "Sun", 0.0, 60.0, originator="x", created_t_s=0.0)


@pytest.mark.parametrize(("method", "degree", "reach"), [
    ("LINEAR", "1", (0, 1)), ("HERMITE", "3", (0, 1)), ("HERMITE", "7", (-1, 2)), ("LAGRANGE", "3", (-1, 2)),
    ("LAGRANGE", "4", (-2, 2)), ("LAGRANGE", "8", (-4, 4)),
])  # fmt: skip
def test_a_position_depends_on_the_nearest_states_only(
    method: str, degree: str, reach: tuple[int, int], cbers: Elements
) -> None:
    """States from `reach[0]` to `reach[1]` about the one before count; a kilometre in any other moves nothing."""
    states, before = teme_states(cbers), 6
    t_s = float(TIMES[before] + 0.3 * STEP_S)

    def position(spoiled: int | None) -> np.ndarray:
        changed = [state + (index == spoiled) * np.array([1.0, 0, 0, 0, 0, 0]) for index, state in enumerate(states)]
        text = text_of(changed, REF_FRAME="ITRF", INTERPOLATION=method, INTERPOLATION_DEGREE=degree)
        return np.array(OemTarget(read_oem(text)).motion_at(t_s).position)

    plain = position(None)
    moved = [index - before for index in range(len(states)) if np.abs(position(index) - plain).max() > 1e-3]
    assert moved == list(range(reach[0], reach[1] + 1))


def test_a_segment_inside_another_shortens_nothing(cbers: Elements) -> None:
    """One of 1.5 s, less than the light time kept clear at both ends, makes no span of its own."""
    states, meta = teme_states(cbers), {"INTERPOLATION": "LINEAR", "INTERPOLATION_DEGREE": "1"}
    whole = text_of(states, **meta)
    inner = "META_START" + text_of(states[4:8], times=TIMES[4:8], **meta).split("META_START", 1)[1]
    ((first, last),) = OemTarget(read_oem(whole + inner)).spans_t_s
    assert (first, last) == pytest.approx((TIMES[0] + 1.0, TIMES[-1] - 1.0), abs=1e-6)
    short = {"USEABLE_START_TIME": utc_text(TIMES[-2]), "USEABLE_STOP_TIME": utc_text(TIMES[-2] + 1.5)}
    alone = "META_START" + text_of(states[12:], times=TIMES[12:], **meta, **short).split("META_START", 1)[1]
    early = text_of(states[:6], times=TIMES[:6], **meta)
    ((first, last),) = OemTarget(read_oem(early + alone)).spans_t_s
    assert (first, last) == pytest.approx((TIMES[0] + 1.0, TIMES[5] - 1.0), abs=1e-6)


def test_states_in_earth_fixed_axes_do_not_depend_on_the_turn_of_the_earth(cbers: Elements, goldstone: Site) -> None:
    """An orientation that is uncertain by 10 ms moves inertial states on the sky, and these not at all."""
    position, velocity = cubic(TIMES)
    for frame, moves in (("ITRF-2020", False), ("GCRF", True)):
        text = text_of(list(np.hstack([position, velocity])), REF_FRAME=frame)
        track = TopocentricTrack(OemTarget(read_oem(text), AssumedOrientation(sigmas=(0.01, 0.0))), goldstone)
        sigma_rad = orientation_sigma_rad(track, float(TIMES[4]))
        assert (sigma_rad > 1e-9) == moves
        assert moves or sigma_rad == 0.0


def test_segments_are_of_one_object_and_at_least_one(cbers: Elements) -> None:
    states = teme_states(cbers)
    one = read_oem(text_of(states))
    with pytest.raises(ValueError, match="segments must be one or more of one object"):
        OemTarget([])
    with pytest.raises(ValueError, match="segments must be one or more of one object"):
        OemTarget([*one, *read_oem(text_of(states, OBJECT_ID="2003-049B"))])
    with pytest.raises(ValueError, match="in all segments"):
        OemTarget([*one, *read_oem(text_of(states, REF_FRAME="GCRF"))])


def test_barycentric_time_runs_ahead_and_behind_by_the_sine_of_the_earths_anomaly() -> None:
    """TDB - TT = 1.657 ms sin(628.3076 T + 6.2401) (Fairhead and Bretagnon 1990), to 30 microseconds."""
    for text in ("2006-04-04T12:00:00", "2006-10-03T18:00:00"):
        written_s = from_utc_text(text)
        centuries = (written_s - 946728000.0) / (36525.0 * 86400.0)
        ahead_s = 1.657e-3 * math.sin(628.3076 * centuries + 6.2401)
        assert abs(ahead_s) > 1.6e-3
        assert tai_from_text(text, "TDB") - (written_s - 32.184 - ahead_s) == pytest.approx(0.0, abs=3e-5)


def test_accelerations_behind_a_state_are_allowed_and_left_out(cbers: Elements) -> None:
    plain = text_of(teme_states(cbers))
    rows = [row + " 1e-3 2e-3 3e-3" if row[:4] == "2006" else row for row in plain.splitlines()]
    (found,), (wanted,) = read_oem("\n".join(rows)), read_oem(plain)
    np.testing.assert_array_equal(found.position_m, wanted.position_m)
    np.testing.assert_array_equal(found.velocity_m_s, wanted.velocity_m_s)
    for more in (" 1", " 1 2", " 1 2 3 4"):
        with pytest.raises(ValueError, match="line 15: a state must have an epoch and 6 or 9 numbers"):
            read_oem(plain.replace("2006-06-27T04:58:20.000", "2006-06-27T04:58:20.000" + more))


def test_two_states_are_a_segment_and_one_is_none() -> None:
    state = np.array([7000.0, 0.0, 0.0, 0.0, 7.5, 0.0])
    meta = {"REF_FRAME": "ITRF", "INTERPOLATION": "LINEAR", "INTERPOLATION_DEGREE": ""}
    (segment,) = read_oem(text_of([state] * 2, times=TIMES[:2], **meta))
    assert (segment.method, segment.degree, len(segment.tai_s)) == ("LINEAR", 1, 2)
    stop = utc_text(TIMES[0] + 1.0)
    with pytest.raises(ValueError, match="OEM segment of CBERS 2 has 1 states, must have 2 or more"):
        read_oem(text_of([state], times=TIMES[:1], STOP_TIME=stop, **meta))


def test_covariances_come_back_from_a_written_message(cbers: Elements) -> None:
    (segment,) = read_oem(text_of(teme_states(cbers)))
    root = random_stream(3, "covariance").standard_normal((6, 6)) * np.array([100.0] * 3 + [0.1] * 3)[:, np.newaxis]
    block = StateCovariance(float(segment.tai_s[3]), "RTN", root @ root.T)
    text = oem_text(
        OemTarget([segment]), "X", float(TIMES[2]), float(TIMES[-3]), originator="TEST",
        created_t_s=0.0, covariances=[block],
    )  # fmt: skip
    (found,) = read_oem(text)[0].covariances
    assert (found.tai_s, found.frame) == (block.tai_s, "RTN")
    assert np.allclose(found.matrix, block.matrix, rtol=1e-8, atol=1e-12)
