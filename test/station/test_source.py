"""From the operator's words to a track; what cannot be found or used is named."""

from pathlib import Path

import pytest

from rf_pointing.ephemeris import find_elements, site, tle_lines, verification_elements
from rf_pointing.station.source import SourceParams, load_elements, load_track


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


def test_a_file_gives_the_same_track_as_the_verification_set(cbers_2: Path) -> None:
    ours, theirs = load_track(SourceParams(elements_file=str(cbers_2))), load_track(SourceParams())
    t_s = load_elements(SourceParams()).epoch_t_s + 4000.0
    assert ours.target_at(t_s).azimuth_rad == pytest.approx(theirs.target_at(t_s).azimuth_rad, abs=1e-6)


def test_offsets_move_the_target_against_its_elements() -> None:
    t_s = load_elements(SourceParams()).epoch_t_s + 4000.0
    ahead = load_track(SourceParams(along_track_offset_s=10.0)).target_at(t_s)
    later = load_track(SourceParams()).target_at(t_s + 10.0)
    # Ten seconds of the Earth's turning remain.
    assert ahead.elevation_rad == pytest.approx(later.elevation_rad, abs=1e-3)


def test_a_missing_file_is_named() -> None:
    with pytest.raises(ValueError, match=r"elements_file='/nowhere/x.tle' does not exist"):
        load_elements(SourceParams(elements_file="/nowhere/x.tle"))


def test_malformed_elements_name_the_file(cbers_2: Path) -> None:
    lines = cbers_2.read_text().splitlines()
    lines[1] = lines[1][:-1] + str((int(lines[1][-1]) + 1) % 10)
    cbers_2.write_text("\n".join(lines))
    with pytest.raises(ValueError, match=r"^cbers\.tle: .*checksum"):
        load_elements(SourceParams(elements_file=str(cbers_2)))


def test_an_unknown_satellite_is_refused_with_near_names(cbers_2: Path) -> None:
    with pytest.raises(ValueError, match=r"satellite='CBERS 3' is not among 1 elements; nearest: CBERS 2"):
        load_elements(SourceParams(elements_file=str(cbers_2), satellite="CBERS 3"))
    with pytest.raises(ValueError, match=r"satellite='99999' is not among"):
        load_elements(SourceParams(satellite="99999"))


def test_an_unknown_station_is_refused() -> None:
    with pytest.raises(ValueError, match="Atlantis"):
        load_track(SourceParams(station="Atlantis"))


def test_expired_elements_are_refused() -> None:
    track = load_track(SourceParams(max_age_days=2.0))
    epoch_t_s = load_elements(SourceParams()).epoch_t_s
    track.target_at(epoch_t_s + 1.9 * 86400.0)
    with pytest.raises(ValueError, match=r"(?i)2\.\d* ?d"):
        track.target_at(epoch_t_s + 2.1 * 86400.0)
