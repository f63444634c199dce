"""One commander at a time; faults that stay; the turn that survives a restart."""

import math
from pathlib import Path

import pytest

from rf_pointing.planning import Authority, FaultLatch, WrapCount


def test_the_first_commander_keeps_the_authority_until_it_is_silent() -> None:
    authority = Authority(1.0)
    assert authority.conflict("/gs1/controller", 0.0) == ""
    authority.claim("/gs1/controller", 0.0)
    assert authority.conflict("/gs1/panel", 0.5) == "conflict: /gs1/controller commands, /gs1/panel is refused"
    assert authority.conflict("/gs1/controller", 1.4) == ""
    authority.claim("/gs1/controller", 1.4)
    assert authority.conflict("", 2.0) == "conflict: /gs1/controller commands, an unnamed one is refused"
    assert authority.conflict("/gs1/panel", 2.5) == ""
    authority.claim("/gs1/panel", 2.5)
    authority.release()
    assert authority.conflict("/gs1/controller", 2.5) == ""


def test_a_fault_keeps_its_last_commands_and_clears_only_without_its_cause() -> None:
    latch = FaultLatch()
    assert latch.reset("") == "no fault is latched"
    for number in range(8):
        latch.note_command((float(number), "/gs1/controller", 1.0, 0.5))
    latch.latch("encoder jumped", 8.0)
    latch.latch("drive ran away", 9.0)
    assert latch.text == "encoder jumped; drive ran away"
    assert [command[0] for command in latch.fault.commands] == [3.0, 4.0, 5.0, 6.0, 7.0]
    assert latch.fault.lines()[-1] == "1.00 s before, /gs1/controller: to 57.296, 28.648 deg"
    assert latch.reset("encoder gives no number") == "the cause is still there: encoder gives no number"
    assert latch.text
    assert latch.reset("") == ""
    assert latch.text == ""


@pytest.mark.parametrize("azimuth_deg", [-200.0, -10.0, 170.0, 190.0, 219.0])
def test_the_turn_is_recovered_from_an_encoder_that_knows_only_one(tmp_path: Path, azimuth_deg: float) -> None:
    kept = WrapCount(tmp_path / "wrap.json")
    kept.keep(math.radians(azimuth_deg))
    shown = math.remainder(math.radians(azimuth_deg + 0.5), 2.0 * math.pi)
    azimuth, doubt = WrapCount(tmp_path / "wrap.json").recover(shown)
    assert doubt == ""
    assert math.degrees(azimuth) == pytest.approx(azimuth_deg + 0.5)


def test_an_antenna_that_was_moved_while_off_is_not_trusted(tmp_path: Path) -> None:
    WrapCount(tmp_path / "wrap.json").keep(math.radians(30.0))
    assert "moved while off" in WrapCount(tmp_path / "wrap.json").recover(math.radians(75.0))[1]


def test_a_half_written_file_is_named_and_a_missing_one_is_the_first_start(tmp_path: Path) -> None:
    path = tmp_path / "wrap.json"
    assert WrapCount(path).recover(1.0) == (1.0, "")
    for text in ("", '{"azimuth_rad": ', '{"azimuth_rad": NaN}', "[1.0]"):
        path.write_text(text)
        assert "cannot be read" in WrapCount(path).recover(1.0)[1]


def test_the_file_is_replaced_whole(tmp_path: Path) -> None:
    wrap = WrapCount(tmp_path / "wrap.json")
    wrap.keep(1.0)
    wrap.keep(1.0 + math.radians(0.1))
    assert '"azimuth_rad": 1.0}' in (tmp_path / "wrap.json").read_text(), "not worth writing"
    wrap.keep(2.0)
    assert '"azimuth_rad": 2.0}' in (tmp_path / "wrap.json").read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["wrap.json"]


def test_a_commander_keeps_the_authority_for_the_time_of_silence_and_no_longer() -> None:
    authority = Authority(1.0)
    assert authority.conflict("panel", -1e9) == ""
    authority.claim("controller", 5.0)
    assert authority.conflict("panel", 6.0) != ""
    assert authority.conflict("panel", 6.01) == ""
    assert authority.conflict("controller", 100.0) == ""
    authority.release()
    assert (authority.holder, authority.conflict("panel", 5.0)) == ("", "")


def test_what_follows_from_a_fault_is_added_once() -> None:
    latch = FaultLatch()
    latch.note_command((1.0, "", 0.1, 0.2))
    for text, t_s in (("drive ran away", 4.0), ("encoder jumped", 5.0), ("drive ran away", 6.0), ("jumped", 7.0)):
        latch.latch(text, t_s)
        latch.note_command((t_s, "late", 0.0, 0.0))
    assert latch.fault is not None
    assert (latch.text, latch.fault.t_s) == ("drive ran away; encoder jumped", 4.0)
    assert latch.fault.lines() == ["3.00 s before, unnamed: to 5.730, 11.459 deg"]


@pytest.mark.parametrize(("off_deg", "trusted"), [(9.9, True), (-9.9, True), (10.1, False), (-10.1, False)])
def test_an_azimuth_is_believed_within_ten_degrees_of_what_was_kept(
    tmp_path: Path, off_deg: float, trusted: bool
) -> None:
    wrap = WrapCount(tmp_path / "wrap.json")
    wrap.keep(math.radians(-345.0))
    azimuth, doubt = WrapCount(tmp_path / "wrap.json").recover(math.radians(15.0 + off_deg))
    assert math.degrees(azimuth) == pytest.approx(-345.0 + off_deg)
    assert (doubt == "") is trusted


def test_an_encoder_of_one_turn_is_folded_about_north_at_the_first_start(tmp_path: Path) -> None:
    azimuth, doubt = WrapCount(tmp_path / "wrap.json").recover(math.radians(350.0))
    assert (round(math.degrees(azimuth), 9), doubt) == (-10.0, "")
    (tmp_path / "wrap.json").write_text('{"azimuth_rad": 50.1}')
    assert "is not an azimuth of an antenna" in WrapCount(tmp_path / "wrap.json").recover(0.0)[1]
    (tmp_path / "wrap.json").write_text('{"azimuth_rad": -49.9}')
    assert "moved while off" in WrapCount(tmp_path / "wrap.json").recover(2.0)[1]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_half_a_degree_is_worth_a_write(tmp_path: Path, side: float) -> None:
    wrap = WrapCount(tmp_path / "wrap.json")
    wrap.keep(1.0)
    for off_deg, written in ((0.49, False), (0.51, True)):
        wrap.keep(1.0 + side * math.radians(off_deg))
        assert ('"azimuth_rad": 1.0}' not in (tmp_path / "wrap.json").read_text()) is written
