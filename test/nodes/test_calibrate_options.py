"""What `calibrate` plans before anything is started, and how it goes on with a campaign that was interrupted."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.calibration import CandidatePass, Observations, SectorRule
from rf_pointing.commands import calibrate, track_options
from rf_pointing.core.dates import parse_utc
from rf_pointing.ephemeris import tle_lines
from rf_pointing.station.description import read_station


@pytest.fixture
def few_beacons(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave every fifth beacon in the sky."""
    whole = calibrate.beacons
    monkeypatch.setattr(calibrate, "beacons", lambda epoch_t_s: whole(epoch_t_s)[::5])


def options(tmp_path: Path, *more: str):
    return calibrate.arguments(["--longest", "1200", "--fewest", "10", "--models", str(tmp_path), *more])


def points_of(one: CandidatePass, number: int) -> Observations:
    """Return what a calibrator would have kept of a piece of a pass."""
    track = one.track
    return Observations(
        station="Goldstone DSS-13", band="X", t_s=track.t_s, pass_id=np.full(len(track.t_s), number),
        observed_azimuth_rad=track.azimuth_rad, observed_elevation_rad=track.elevation_rad,
        true_azimuth_rad=track.azimuth_rad, true_elevation_rad=track.elevation_rad,
        azimuth_rate_rad_s=track.azimuth_rate_rad_s, elevation_rate_rad_s=track.elevation_rate_rad_s,
        azimuth_acceleration_rad_s2=track.azimuth_acceleration_rad_s2,
        elevation_acceleration_rad_s2=track.elevation_acceleration_rad_s2,
        sigma_azimuth_rad=np.full(len(track.t_s), 1e-5), sigma_elevation_rad=np.full(len(track.t_s), 1e-5),
    )  # fmt: skip


def in_sector(points: Observations, sector: int) -> Observations:
    """Return the points all at rest in the middle of one of the 36 sectors."""
    azimuth, low, high = (
        np.radians(30.0 * (sector % 12) + 15.0),
        *np.radians(((10, 30), (30, 60), (60, 80))[sector // 12]),
    )
    angles = {"azimuth_rad": np.full(len(points), azimuth), "elevation_rad": np.full(len(points), 0.5 * (low + high))}
    angles = {f"{kind}_{name}": value for kind in ("observed", "true") for name, value in angles.items()}
    at_rest = {
        f"{axis}_{name}": np.zeros(len(points))
        for axis in ("azimuth", "elevation")
        for name in ("rate_rad_s", "acceleration_rad_s2")
    }
    return replace(points, **angles, **at_rest)


@pytest.mark.usefixtures("few_beacons")
def test_an_interrupted_campaign_goes_on_after_its_last_observation_where_the_sky_is_thin(tmp_path: Path) -> None:
    schedule = calibrate.plan(options(tmp_path))
    whole, windows = schedule.campaign, schedule.windows
    done = whole.passes[: len(whole.passes) // 2]
    assert done
    journal = calibrate.journal_of(options(tmp_path))
    for number, one in enumerate(done):
        journal.append(points_of(one, number))

    resumed = calibrate.plan(options(tmp_path, "--resume"))
    rest, remaining = resumed.campaign, resumed.windows
    kept = calibrate.journal_of(options(tmp_path)).points
    before = SectorRule(fewest=10).coverage(kept.true_azimuth_rad, kept.true_elevation_rad)
    assert remaining[0].aos_t_s > kept.t_s[-1]
    assert windows[0].aos_t_s > parse_utc(calibrate.DEFAULT_START)
    assert set(rest.coverage.thin) < set(before.thin)
    for one in rest.passes:
        seen = SectorRule(fewest=10).coverage(one.track.azimuth_rad, one.track.elevation_rad)
        assert any(seen.counts[sector] for sector in before.thin), "a piece that only fills what is full already"
    assert np.all(rest.coverage.counts >= before.counts)


@pytest.mark.usefixtures("few_beacons")
def test_the_shadow_is_tracked_after_the_campaign(tmp_path: Path) -> None:
    schedule = calibrate.plan(options(tmp_path, "--shadow", "2"))
    assert len(schedule.shadow) == 2
    assert schedule.shadow[0].aos_t_s > schedule.windows[-1].los_t_s
    assert schedule.shadow[1].aos_t_s > schedule.shadow[0].los_t_s
    assert "2 more in the shadow" in calibrate.plan_text(schedule)


@pytest.mark.usefixtures("few_beacons")
def test_a_campaign_that_is_complete_is_resumed_with_the_fit(tmp_path: Path) -> None:
    journal = calibrate.journal_of(options(tmp_path))
    track = calibrate.plan(options(tmp_path)).campaign.passes[0]
    for number, sector in enumerate(range(36)):
        journal.append(in_sector(points_of(track, number).select(np.arange(10)), sector))
    schedule = calibrate.plan(options(tmp_path, "--resume"))
    assert schedule.windows == []
    assert len(schedule.shadow) == 3
    assert calibrate.plan_text(schedule).startswith("36 of 36 sectors are full already; 3 more in the shadow")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--shadow", "1"], "shadow=1 must be >= 2"),
        (["--longest", "-5"], "longest=-5.0 must be >= 60"),
        (["--longest", "nan"], "longest=nan must be finite"),
        (["--orbit-prior", "0"], "orbit_prior=0.0 must be >= 0.01"),
        (["--fewest", "0"], "fewest=0 must be >= 1"),
        (["--models", ""], "models='' must name a folder"),
        (["--start", "yesterday"], "yesterday"),
        (["--speed", "fast"], "speed='fast' must be a factor or max"),
    ],
)
def test_wrong_options_are_refused_in_words_before_anything_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], complaint: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        calibrate.main(["--models", str(tmp_path), "--output", str(tmp_path / "out"), *arguments])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_without_observations_there_is_nothing_to_resume(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no observations of Goldstone DSS-13 in band S to resume from"):
        calibrate.plan(options(tmp_path, "--resume", "--band", "S"))


@pytest.mark.usefixtures("few_beacons")
def test_its_options_are_all_that_a_run_of_the_station_asks_for(tmp_path: Path) -> None:
    """The run is `track`'s: an option that only that one has must have a value here."""
    given = options(tmp_path, "--band", "S", "--seed", "4")
    schedule = calibrate.plan(given)
    given.elements = str(tmp_path / "beacons.tle")
    Path(given.elements).write_text(
        "\n".join(line for one in schedule.elements for line in (one.name, *tle_lines(one)))
    )
    values = track_options.parameters(given, schedule.windows[0], tmp_path)
    assert values["rf_receiver"]["signal.seed"] == 4
    assert values["bias_calibrator"]["calibrator.keep_observations"]
    assert values["bias_calibrator"]["band"] == "S"
    assert track_options.parameter_files(given, values, tmp_path) == [tmp_path / "run.yaml"]
    assert track_options.notes(given)["band"] == "S"
    assert track_options.bag_folder(given, tmp_path) == tmp_path / "bag"


def test_a_real_antenna_is_calibrated_on_real_satellites(tmp_path: Path) -> None:
    station = tmp_path / "roof.yaml"
    read_station("dss13").write(station, {"drive.type": "hamlib", "wind.anemometer": False})
    line = ["--station", str(station), "--start", "2006-06-25T00:00:00", "--longest", "7200"]
    with pytest.raises(ValueError, match="elements='' must name satellites: the beacons of a simulated sky"):
        calibrate.plan(options(tmp_path, *line))
    sky = tmp_path / "sky.tle"
    sky.write_text(
        "\n".join(line for one in calibrate.beacons(parse_utc("2006-06-25"))[::9] for line in tle_lines(one))
    )
    schedule = calibrate.plan(options(tmp_path, *line, "--elements", str(sky)))
    assert schedule.windows
    assert len(schedule.shadow) == 3
    assert {one.catalogue_number for one in schedule.elements} == {90001 + 9 * each for each in range(50)}
