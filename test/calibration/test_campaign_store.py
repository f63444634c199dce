import numpy as np
import pytest

from rf_pointing.calibration import load_campaign, save_pass


def test_saved_passes_load_as_one_campaign_and_a_pass_saved_twice_counts_once(campaign, table_1, tmp_path):
    data = campaign(table_1, passes=3)
    for number in (0, 1, 2, 1):
        save_pass(tmp_path / "c", data.select(data.pass_id == number))
    back = load_campaign(tmp_path / "c")
    assert np.array_equal(back.pass_id, data.pass_id)
    assert back.observed_azimuth_rad == pytest.approx(data.observed_azimuth_rad, rel=1e-14)


def test_a_pass_cut_off_while_it_was_written_does_not_spoil_the_others(campaign, table_1, tmp_path):
    data = campaign(table_1, passes=2)
    for number in (0, 1):
        save_pass(tmp_path, data.select(data.pass_id == number))
    (tmp_path / "pass_000002.csv.part").write_text("# station: gs1\nt_s,pa")
    assert len(load_campaign(tmp_path)) == len(data)


def test_an_empty_folder_and_several_passes_in_one_file_are_refused(campaign, table_1, tmp_path):
    with pytest.raises(ValueError, match="holds no passes"):
        load_campaign(tmp_path)
    with pytest.raises(ValueError, match="passes=2 must be 1"):
        save_pass(tmp_path, campaign(table_1, passes=2))
