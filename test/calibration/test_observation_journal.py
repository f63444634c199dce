"""Points survive a killed process: what was appended is there again, a torn last line is cut off, damage is refused."""

import numpy as np
import pytest

from rf_pointing.calibration import ObservationJournal, read_observations


@pytest.fixture
def data(campaign, table_1):
    return campaign(table_1, passes=2)


def journal(tmp_path):
    return ObservationJournal(tmp_path / "c" / "observations.csv", "gs1", "S")


def test_points_appended_one_by_one_are_there_when_opened_again(data, tmp_path):
    first = journal(tmp_path)
    assert first.points is None
    for row in range(len(data)):
        first.append(data.select([row]))
    back = journal(tmp_path).points
    assert np.array_equal(back.pass_id, data.pass_id)
    assert back.observed_azimuth_rad == pytest.approx(data.observed_azimuth_rad, rel=1e-14)


@pytest.mark.parametrize("torn", [1, 7, 60])
def test_a_line_cut_off_by_a_kill_is_dropped_and_the_next_point_follows_cleanly(data, tmp_path, torn):
    first = journal(tmp_path)
    first.append(data.select(np.arange(5)))
    with first.path.open("rb+") as stream:
        stream.truncate(first.path.stat().st_size - torn)
    again = journal(tmp_path)
    assert len(again.points) == 4
    again.append(data.select([5]))
    assert journal(tmp_path).points.t_s == pytest.approx(data.t_s[[0, 1, 2, 3, 5]])


def test_a_file_cut_off_in_its_header_begins_anew(data, tmp_path):
    first = journal(tmp_path)
    first.append(data.select([0]))
    first.path.write_bytes(first.path.read_bytes()[:40])
    again = journal(tmp_path)
    assert again.points is None
    again.append(data)
    assert len(journal(tmp_path).points) == len(data)


def test_other_damage_is_refused_with_its_line_and_left_as_it_is(data, tmp_path):
    first = journal(tmp_path)
    first.append(data.select(np.arange(5)))
    lines = first.path.read_text().splitlines()
    lines[5] = "rubbish"
    first.path.write_text("\n".join(lines) + "\n")
    with pytest.raises(ValueError, match=r"observations\.csv: line 6: 1 values, must be"):
        journal(tmp_path)
    assert "rubbish" in first.path.read_text()


def test_another_station_or_band_is_refused(data, tmp_path):
    journal(tmp_path).append(data)
    with pytest.raises(ValueError, match="points of station 'gs1', must be of 'gs2'"):
        ObservationJournal(tmp_path / "c" / "observations.csv", "gs2", "S")
    with pytest.raises(ValueError, match="points of band 'S', must be of 'X'"):
        ObservationJournal(tmp_path / "d.csv", "gs1", "X").append(data)


def test_an_old_campaign_is_set_aside_and_never_overwritten(data, tmp_path):
    first = journal(tmp_path)
    assert first.set_aside("old") is None
    first.append(data)
    assert first.set_aside("old").name == "observations-old.csv"
    first.append(data)
    assert first.set_aside("old").name == "observations-old-2.csv"
    assert len(read_observations(first.path.with_name("observations-old.csv"))) == len(data)


def test_a_disk_that_is_full_leaves_the_file_as_it_was(data, tmp_path, monkeypatch):
    first = journal(tmp_path)
    first.append(data.select(np.arange(3)))
    before = first.path.read_bytes()

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("rf_pointing.calibration.observation_journal.os.fsync", full)
        with pytest.raises(OSError, match="No space left"):
            first.append(data.select([3]))
    assert first.path.read_bytes() == before
    first.append(data.select([3, 4]))
    assert journal(tmp_path).points.t_s == pytest.approx(data.t_s[:5])
