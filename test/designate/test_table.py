"""A flight from a file: what it says, where it lies, and what is wrong in it."""

import math
from pathlib import Path

import numpy as np
import pytest
from rf_pointing.designate import ReportNoise, read_table
from rf_pointing.ephemeris import Site, TopocentricTrack

SITE = Site.from_degrees(40.0, -3.0, 500.0)


def write(folder: Path, *rows: str) -> Path:
    file = folder / "flight.csv"
    file.write_text("\n".join(rows) + "\n")
    return file


def test_directions_come_out_as_they_went_in(tmp_path: Path) -> None:
    """Also between the rows, where the motion is smooth; rates are those of the angles."""

    def direction(t: float) -> tuple[float, float]:
        return 30.0 + 4.0 * math.sin(0.05 * t), 20.0 + 0.1 * t

    rows = [f"{1.8e9 + t},{direction(t)[0]!r},{direction(t)[1]!r},50000" for t in range(100)]
    found = read_table(
        write(tmp_path, "time,azimuth_deg,elevation_deg,range_m", *rows), SITE, ReportNoise()
    )
    track = TopocentricTrack(found, SITE, refraction=None)
    for t in (3.0, 17.5, 61.25):
        seen = track.target_at(1.8e9 + t)
        # The range takes light 0.2 ms.
        assert math.degrees(seen.azimuth_rad) == pytest.approx(direction(t)[0], abs=1e-4)
        assert math.degrees(seen.elevation_rad) == pytest.approx(direction(t)[1], abs=1e-4)
        assert math.degrees(seen.azimuth_rate_rad_s) == pytest.approx(
            0.2 * math.cos(0.05 * t), abs=1e-3
        )
        assert seen.range_m == pytest.approx(5e4, abs=1.0)


def test_places_may_have_times_in_words(tmp_path: Path) -> None:
    rows = [f"2026-06-21T09:00:{10 * row:02d}Z,40.{row},-3.0,{1000.0 + row}" for row in range(6)]
    found = read_table(
        write(tmp_path, "time,latitude_deg,longitude_deg,height_m", *rows), SITE, ReportNoise()
    )
    first_s, last_s = found.spans_t_s[0]
    assert last_s - first_s == pytest.approx(50.0)
    there = np.array(Site.from_degrees(40.2, -3.0, 1002.0).position_m)
    np.testing.assert_allclose(found.motion_at(first_s + 20.0).position, there, atol=1e-6)
    with pytest.raises(ValueError, match=r"flight has no place 1\.0 s after its last row"):
        found.motion_at(last_s + 1.0)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (["a,b"], "columns 'a,b' must be time,latitude_deg"),
        (["time,azimuth_deg,elevation_deg", "1,2,3"], "1 rows, must be >= 4"),
        (["time,azimuth_deg,elevation_deg", "1,2,nan"], "row 2: elevation_rad=nan"),
        (["time,azimuth_deg,elevation_deg", "1,2,95"], "row 2: elevation_rad"),
        (["time,azimuth_deg,elevation_deg", "1,2"], "row 2: "),
        (
            ["time,azimuth_deg,elevation_deg", *[f"{t},2,3" for t in (1, 2, 2, 3)]],
            "row 3 is 0 s after",
        ),
        (["time,azimuth_deg,elevation_deg", "x,2,3"], "row 2: start='x'"),
    ],
)
def test_what_is_wrong_is_named_by_its_row(tmp_path: Path, rows: list[str], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        read_table(write(tmp_path, *rows), SITE, ReportNoise())
