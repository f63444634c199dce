"""Pictures are drawn from whatever a recording holds, and show what it holds."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from rf_pointing.planning import HorizonMask
from rf_pointing.planning.horizon import horizon_to_notes
from rf_pointing.report.analysis import Analysis, analyse
from rf_pointing.report.definitions import Definitions
from rf_pointing.report.picture_style import LIMIT_COLOUR, mode_colour, mode_runs, per_second
from rf_pointing.report.pictures import draw_beam, draw_error, draw_link, draw_pictures, draw_sky
from rf_pointing.report.recording import read_recording

ERROR_PICTURES = {"pointing_error": draw_error, "link": draw_link, "beam": draw_beam}
ALL = ["pointing_error", "link", "sky_track", "beam", "axes", "timing"]


@pytest.fixture(scope="module")
def analysed(
    tmp_path_factory: pytest.TempPathFactory, synthetic_run: type[Any], types: Definitions
) -> Callable[..., Analysis]:
    def make(notes: dict[str, str] | None = None, **plan: Any) -> Analysis:
        path = tmp_path_factory.mktemp("pictures") / "bag"
        synthetic_run(**{"seconds": 4.0, "aos_los_s": (1.0, 3.0), **plan}).write(path, types, notes)
        return analyse(read_recording(path))

    return make


def coloured(path: Path, colour: str) -> np.ndarray:
    """Row and column, from 0 to 1, of the pixels close to `colour`."""
    image = imread(path)[:, :, :3]
    wanted = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    rows, columns = np.nonzero(np.max(np.abs(image - wanted), axis=2) < 0.12)
    return np.stack([rows / image.shape[0], columns / image.shape[1]], axis=-1)


def test_whole_recording_gives_every_picture(analysed: Callable[..., Analysis], tmp_path: Path) -> None:
    pictures = draw_pictures(analysed(error_mdeg=lambda t: (1.0 + t, 2.0)), tmp_path)
    assert [path.stem for path in pictures] == ALL
    for path, words in pictures.items():
        assert imread(path).shape[1] >= 700
        assert len(words) == 2
        assert all(words)


def test_colours_name_the_modes(analysed: Callable[..., Analysis], tmp_path: Path) -> None:
    analysis = analysed(mode=lambda t: "conscan" if t < 2.0 else "coast", error_mdeg=lambda t: (1.0 + t, 2.0))
    for name, draw in ERROR_PICTURES.items():
        draw(analysis, tmp_path / f"{name}.png")
        assert len(coloured(tmp_path / f"{name}.png", mode_colour("conscan"))) > 20
        assert len(coloured(tmp_path / f"{name}.png", mode_colour("coast"))) > 20
        assert len(coloured(tmp_path / f"{name}.png", mode_colour("search"))) == 0


@pytest.mark.parametrize(
    ("azimuth_deg", "elevation_deg", "row", "column"),
    [(90.0, 30.0, 0.49, 0.80), (180.0, 30.0, 0.75, 0.49), (-90.0, 30.0, 0.49, 0.20), (90.0, 150.0, 0.49, 0.20)],
)
def test_sky_has_north_up_and_east_right_and_folds_over_the_zenith(
    analysed: Callable[..., Analysis], tmp_path: Path, azimuth_deg: float, elevation_deg: float,
    row: float, column: float,
) -> None:  # fmt: skip
    analysis = analysed(azel_deg=lambda t: (azimuth_deg + t, elevation_deg), left_out={"passes", "tracking_status"})
    draw_sky(analysis, tmp_path / "sky_track.png")
    track = coloured(tmp_path / "sky_track.png", "#66aad0")
    inside = track[(track[:, 0] > 0.1) & (track[:, 0] < 0.84)]
    assert np.median(inside, axis=0) == pytest.approx([row, column], abs=0.03)


@pytest.mark.parametrize("damaged", [False, True])
def test_sky_has_the_hills_of_the_station_that_was_recorded(
    analysed: Callable[..., Analysis], tmp_path: Path, damaged: bool
) -> None:
    """A hill of 30 deg in the east covers the outer third of the circle there, and nothing else."""
    azimuth, elevation = (tuple(np.radians(each)) for each in ([0.0, 60.0, 61.0, 119.0, 120.0], [0, 0, 30, 30, 0]))
    notes = horizon_to_notes(HorizonMask(azimuth_rad=azimuth, elevation_rad=elevation))
    analysis = analysed({name: text[: -4 * damaged or None] for name, text in notes.items()})
    draw_sky(analysis, tmp_path / "sky.png")
    hill = coloured(tmp_path / "sky.png", "#b0b4b8")
    hill = hill[(hill[:, 0] > 0.2) & (hill[:, 0] < 0.8)]
    if damaged:
        assert len(hill) < 2000
        return
    assert len(hill) > 20_000
    assert np.mean(hill[:, 1] > 0.6) > 0.98
    assert np.mean(hill, axis=0) == pytest.approx([0.49, 0.83], abs=0.03)


def test_sky_draws_no_command_where_there_is_no_target(analysed: Callable[..., Analysis], tmp_path: Path) -> None:
    def parked(t: float) -> tuple[float, float]:
        return (180.0, 30.0) if t < 2.0 else (0.0, 0.0)

    def between(mode: str) -> int:
        analysis = analysed(
            azel_deg=parked, mode=lambda t: "monopulse" if t < 2.0 else mode, truth=False, left_out={"joint_states"}
        )
        draw_sky(analysis, tmp_path / "sky_track.png")
        black = coloured(tmp_path / "sky_track.png", "#222222")
        return int(np.sum((black[:, 0] > 0.3) & (black[:, 0] < 0.42)))

    assert between("coast") > 50
    assert between("idle") == 0


@pytest.mark.parametrize(
    ("kept", "drawn"),
    [
        ({"joint_states"}, ["sky_track", "axes"]),
        ({"tracking_status"}, ["link", "sky_track", "timing"]),
        ({"pointing_error"}, ["pointing_error", "link", "beam"]), ({"antenna_status"}, ["timing"]),
        ({"monopulse"}, ["link"]), ({"target"}, []),
    ],
)  # fmt: skip
def test_each_topic_alone_gives_the_pictures_it_can(
    analysed: Callable[..., Analysis], tmp_path: Path, kept: set[str], drawn: list[str]
) -> None:
    every = {"passes", "clock", "joint_states", "target", "monopulse", "carrier_power", "pointing_error"}
    every |= {"tracking_status", "joint_trajectory", "antenna_status"}
    analysis = analysed(left_out=every - kept, truth=False)
    assert [path.stem for path in draw_pictures(analysis, tmp_path)] == drawn


def test_perfect_and_broken_errors_can_be_drawn(analysed: Callable[..., Analysis], tmp_path: Path) -> None:
    perfect = analysed(beamwidth_mdeg=0.0)
    half = analysed(
        error_mdeg=lambda t: (float("nan") if t < 2.0 else 1.0, 0.0), carrier_to_noise=lambda _: float("nan")
    )
    for name, draw in ERROR_PICTURES.items():
        for number, analysis in enumerate((perfect, half)):
            draw(analysis, tmp_path / f"{name}_{number}.png")
            assert len(coloured(tmp_path / f"{name}_{number}.png", LIMIT_COLOUR)) > 20


def test_mode_runs_cover_every_sample_and_name_each_mode_once(analysed: Callable[..., Analysis]) -> None:
    analysis = analysed(mode=lambda t: "coast" if 1.0 <= t < 1.5 else "monopulse")
    assert analysis.errors is not None
    stamps = analysis.errors.stamp_ns
    runs = list(mode_runs(analysis, stamps))
    assert [(mode, first) for mode, _, first in runs] == [("monopulse", True), ("coast", True), ("monopulse", False)]
    covered = np.concatenate([np.arange(len(stamps))[part] for _, part, _ in runs])
    assert np.array_equal(np.unique(covered), np.arange(len(stamps)))


def test_mean_and_largest_of_each_second() -> None:
    stamps = np.array([0, 400, 900, 2_100, 2_200], dtype=np.int64) * 1_000_000
    middle, mean, largest = per_second(stamps, np.array([1.0, 2.0, np.nan, 4.0, 8.0]))
    assert list(middle) == [500_000_000, 2_500_000_000]
    assert list(mean) == [1.5, 6.0]
    assert list(largest) == [2.0, 8.0]
