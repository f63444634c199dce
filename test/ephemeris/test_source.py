"""From the operator's words to a track; what cannot be found or used is named."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.core import MDEG, RadioRefraction, utc_text
from rf_pointing.ephemeris import (
    Elements,
    ElementUncertainty,
    TopocentricTrack,
    find_elements,
    find_passes,
    site,
    sky_uncertainty,
    stale_warning,
    sun,
    tle_lines,
    verification_elements,
)
from rf_pointing.ephemeris.satellite_antenna import SatelliteAntennaParams
from rf_pointing.ephemeris.source import (
    SourceParams,
    TargetMemory,
    load_catalogue,
    load_elements,
    load_target,
    load_track,
    read_source,
    unused,
)
from test.ephemeris.oem_text import TIMES, teme_states, text_of
from test.ephemeris.omm_text import FIELDS

PASS_T_S = 1151384323.8
"""AOS of the first pass above 40 deg, 12 minutes long."""


@pytest.fixture
def cbers_2(tmp_path: Path) -> Path:
    """Return a file with the elements of CBERS-2."""
    path = tmp_path / "cbers.tle"
    path.write_text("CBERS 2\n" + "\n".join(tle_lines(find_elements(verification_elements(), "28057"))) + "\n")
    return path


def test_the_default_is_cbers_2_over_dss_13() -> None:
    track = load_track(SourceParams())
    assert track.name == "CBERS 2"
    assert track.site == site("Goldstone DSS-13")
    assert load_elements(SourceParams()).epoch_t_s > 1.1e9


def test_a_file_gives_the_same_track_as_the_verification_set(cbers_2: Path) -> None:
    ours, theirs = load_track(SourceParams(elements=str(cbers_2))), load_track(SourceParams())
    t_s = load_elements(SourceParams()).epoch_t_s + 4000.0
    assert ours.target_at(t_s).azimuth_rad == pytest.approx(theirs.target_at(t_s).azimuth_rad, abs=1e-6)


def test_malformed_elements_name_the_file(cbers_2: Path) -> None:
    lines = cbers_2.read_text().splitlines()
    lines[1] = lines[1][:-1] + str((int(lines[1][-1]) + 1) % 10)
    cbers_2.write_text("\n".join(lines))
    with pytest.raises(ValueError, match=r"^cbers\.tle: .*checksum"):
        load_elements(SourceParams(elements=str(cbers_2)))


@pytest.fixture
def oem(tmp_path: Path, cbers: Elements) -> SourceParams:
    """Return an ephemeris file of 14 minutes about a pass of CBERS-2, the last one not usable."""
    path = tmp_path / "cbers.oem"
    usable = {"USEABLE_STOP_TIME": utc_text(TIMES[-2])}
    path.write_text(text_of(teme_states(cbers), **usable, INTERPOLATION="LAGRANGE"))
    return SourceParams(elements=str(path), satellite="cbers 2")


def test_an_ephemeris_message_is_a_source_like_elements(oem: SourceParams) -> None:
    """The file's derivatives are coarse; its positions are SGP4's to a nanometre, so the directions agree."""
    by_message, by_elements = load_track(oem), load_track(SourceParams())
    times = PASS_T_S + np.linspace(0.0, 700.0, 71)
    ours, theirs = by_message.sample(times), by_elements.sample(times)
    assert np.max(np.abs(ours.elevation_rad - theirs.elevation_rad)) < 0.01 * MDEG
    assert np.max(np.abs(ours.azimuth_rad - theirs.azimuth_rad)) < 0.01 * MDEG
    assert load_track(oem.replace(satellite="2003-049a")).name == "CBERS 2"


def test_passes_are_looked_for_where_the_ephemeris_is_usable_and_nowhere_beyond(oem: SourceParams) -> None:
    track = load_track(oem)
    start_t_s = track.spans_t_s[0][0]
    assert start_t_s == pytest.approx(TIMES[0] + 1.0, abs=1e-3)
    (window,) = find_passes(track, start_t_s, 86400.0, math.radians(5.0))
    assert window.aos_t_s == pytest.approx(PASS_T_S, abs=0.05)
    assert window.los_t_s == pytest.approx(PASS_T_S + 714.7, abs=0.1)
    (cut,) = find_passes(track, start_t_s, 86400.0, 0.0)
    assert cut.los_t_s <= TIMES[-2]
    with pytest.raises(ValueError, match="outside the usable span"):
        track.target_at(PASS_T_S + 900.0)
    with pytest.raises(ValueError, match="outside the usable span"):
        find_passes(track, PASS_T_S + 5000.0, 1000.0, 0.1)


def test_an_ephemeris_that_declares_no_interpolation_takes_the_operators(oem: SourceParams) -> None:
    file, t_s = Path(oem.elements), PASS_T_S + 100.0
    declared = load_track(oem).target_at(t_s)
    lines = [line for line in file.read_text().splitlines() if not line.startswith("INTERPOLATION")]
    file.write_text("\r\n".join(lines), encoding="utf-8-sig")
    with pytest.raises(ValueError, match=r"cbers\.oem: OEM of CBERS 2 declares no INTERPOLATION"):
        load_track(oem)
    assert load_track(oem.replace(interpolation="LAGRANGE")).target_at(t_s) == declared
    with pytest.raises(ValueError, match="must be odd"):
        load_track(oem.replace(interpolation="HERMITE", interpolation_degree=6))


def test_the_wide_text_of_a_windows_shell_is_read_and_a_foreign_byte_costs_no_set(cbers_2: Path) -> None:
    plain, text = load_elements(SourceParams(elements=str(cbers_2))), cbers_2.read_text()
    for data in (text.encode("utf-16"), text.replace("CBERS 2", "CBERS ü").encode("latin-1")):
        cbers_2.write_bytes(data)
        read = load_elements(SourceParams(elements=str(cbers_2), satellite="28057"))
        assert dataclasses.replace(read, name=plain.name) == plain


def test_an_unknown_object_of_an_ephemeris_is_refused_with_the_ones_it_holds(oem: SourceParams) -> None:
    with pytest.raises(ValueError, match=r"cbers\.oem: satellite='28057' is not among .*: CBERS 2 \(2003-049A\)"):
        load_track(oem.replace(satellite="28057"))


def test_bodies_of_the_sky_are_targets_by_name() -> None:
    solar = load_track(SourceParams(satellite="sun"))
    seen, wanted = solar.target_at(PASS_T_S), TopocentricTrack(sun(), solar.site).target_at(PASS_T_S)
    assert (seen.azimuth_rad, seen.elevation_rad) == (wanted.azimuth_rad, wanted.elevation_rad)
    for name in ("Moon", "Cassiopeia A", "3c 84"):
        track = load_track(SourceParams(satellite=name))
        assert track.name.casefold() == name.casefold()
        (day,) = find_passes(track, PASS_T_S, 86400.0, math.radians(20.0))[:1]
        assert day.duration_s > 3600.0
        with pytest.raises(ValueError, match="not tracked from mean elements"):
            load_elements(SourceParams(satellite=name))


def test_measured_weather_and_a_vacuum_take_the_place_of_the_standard() -> None:
    low_s = PASS_T_S + 2.0
    lifted = {kind: load_track(SourceParams(refraction=kind, weather=RadioRefraction(relative_humidity=0.9))).target_at(low_s)
              .elevation_rad for kind in ("standard", "measured", "none")}  # fmt: skip
    assert lifted["measured"] - lifted["standard"] > 10.0 * MDEG
    assert lifted["standard"] - lifted["none"] > 100.0 * MDEG


def test_a_folder_is_one_catalogue_and_the_newest_set_of_an_object_counts(cbers_2: Path, oem: SourceParams) -> None:
    folder = cbers_2.parent
    Path(oem.elements).unlink()
    old = dataclasses.replace(find_elements(verification_elements(), "28057"), revolution_number=7)
    newer = dataclasses.replace(old, epoch_t_s=old.epoch_t_s + 86400.0)
    (folder / "later.txt").write_text("\n".join(("CBERS 2", *tle_lines(newer))))
    nine = {**FIELDS, "OBJECT_NAME": "NINE", "NORAD_CAT_ID": "799500123", "EPOCH": "2006-06-26T00:00:00"}
    (folder / "nine.json").write_text(json.dumps([nine]))
    (folder / "README").write_text("what lies here")
    (folder / ".half.tle").write_text("1 28057U")
    assert [one.catalogue_number for one in load_catalogue(str(folder))] == [799500123, 28057]
    assert load_elements(SourceParams(elements=str(folder))).epoch_t_s == pytest.approx(newer.epoch_t_s, abs=1e-3)
    assert load_elements(SourceParams(elements=str(folder), satellite="799500123")).name == "NINE"
    (folder / "half.tle").write_text("1 28057U")
    (folder / "notes.txt").write_text("where these files come from")
    assert [one.catalogue_number for one in load_catalogue(str(folder))] == [799500123, 28057]
    half, notes = read_source(str(folder)).problems
    assert half.startswith("half.tle: line 1: ")
    assert notes.startswith("notes.txt: text holds no elements; it starts with 'where these")
    assert unused(str(folder)) == f"{half}; {notes}"


def test_an_ephemeris_of_a_folder_is_preferred_to_elements_of_the_same_name(cbers_2: Path, oem: SourceParams) -> None:
    folder = cbers_2.parent
    assert not isinstance(load_target(SourceParams(elements=str(folder), satellite="CBERS 2")), Elements)
    assert isinstance(load_target(SourceParams(elements=str(folder), satellite="28057")), Elements)


def test_a_folder_without_elements_and_a_missing_file_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"is a folder without elements: no file ends in \.elements, \.tle"):
        load_elements(SourceParams(elements=str(tmp_path)))
    with pytest.raises(ValueError, match=r"elements='/nowhere/x.tle' does not exist"):
        load_elements(SourceParams(elements="/nowhere/x.tle"))


def test_stale_elements_are_told_with_age_and_error_and_fresh_ones_are_not() -> None:
    track, model = load_track(SourceParams()), ElementUncertainty()
    epoch_t_s = load_elements(SourceParams()).epoch_t_s
    assert stale_warning(track, epoch_t_s + 1.9 * 86400.0, 2.0 * 86400.0, model) == ""
    t_s = epoch_t_s + 3.0 * 86400.0
    sigma_mdeg = sky_uncertainty(track, t_s, model).along_track_rad / MDEG
    text = stale_warning(track, t_s, 2.0 * 86400.0, model, 10.0 * MDEG)
    assert text == (
        f"elements of CBERS 2 are stale: 3.0 days from their epoch, expected error along the track {sigma_mdeg:.0f} mdeg, "
        f"{sigma_mdeg / 10.0:.2g} beamwidths"
    )
    assert stale_warning(load_track(SourceParams(satellite="sun")), t_s, 0.0, model) == ""


def test_without_a_name_the_first_object_is_meant(cbers_2: Path, oem: SourceParams) -> None:
    assert load_elements(SourceParams(elements=str(cbers_2), satellite="")).catalogue_number == 28057
    assert load_track(oem.replace(satellite=" ")).name == "CBERS 2"


def test_what_was_chosen_comes_back_with_its_sets_of_parameters_unless_configured_otherwise(tmp_path: Path) -> None:
    name, configured = str(tmp_path / "target.json"), SourceParams()
    chosen = configured.replace(
        satellite="6251", site=site("Madrid DSS-63"), weather=RadioRefraction(relative_humidity=0.8), hold=True,
        antenna=SatelliteAntennaParams(half_power_beamwidth_rad=0.5, roll_rad=0.1),
    )  # fmt: skip
    fresh = TargetMemory(name, configured)
    assert (fresh.source, fresh.peak_rad, fresh.hold_t_s, fresh.problem) == (configured, 0.0, None, "")
    fresh.keep(chosen, 0.3, None)
    assert (fresh.source, fresh.peak_rad, fresh.hold_t_s) == (chosen, 0.3, None)
    fresh.keep(chosen, 0.4, PASS_T_S)
    again = TargetMemory(name, configured)
    assert (again.source, again.peak_rad, again.hold_t_s) == (chosen, 0.4, PASS_T_S)
    other = TargetMemory(name, configured.replace(along_track_offset_s=1.0))
    assert (other.source.satellite, other.peak_rad, other.hold_t_s) == ("28057", 0.0, None)
