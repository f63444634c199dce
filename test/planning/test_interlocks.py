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
    authority.clock_stepped(-3600.0)
    assert authority.conflict("/gs1/panel", -3597.8) != ""
    assert authority.conflict("/gs1/panel", -3597.5) == ""
    authority.clock_stepped(3600.0)
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
