"""A station plans, certifies and simulates what the rooms below it compute, in degrees and UTC."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.calibration import BiasModel
from rf_pointing.core.dates import from_utc_text
from rf_pointing.ephemeris import find_passes
from rf_pointing.simulation import PassLog
from rf_pointing.station.description import read_station

CBERS = rp.elements("CBERS 2")
START = "2006-06-28T06:00:00"


@pytest.fixture(scope="module")
def station() -> rp.Station:
    return rp.Station()


@pytest.fixture(scope="module")
def passes(station: rp.Station) -> list[rp.StationPass]:
    return station.passes(CBERS, start=START, hours=12.5)


def test_a_station_is_what_its_description_says(station: rp.Station, tmp_path: Path) -> None:
    described = read_station("dss13")
    assert (station.name, station.band, station.bands) == (described.name, "X", ("S", "X", "Ka"))
    assert (station.site, station.sensors, station.simulated) == (described.site, described.sensors("X"), True)
    assert [rp.Station(band=name).beamwidth_deg for name in station.bands] == pytest.approx([0.264, 0.065, 0.017])
    described.write(tmp_path / "mine.yaml", {})
    mine = rp.Station(tmp_path / "mine.yaml", band="Ka")
    assert (mine.name, mine.band) == (station.name, "Ka")
    assert repr(mine) == "Station('Goldstone DSS-13', band='Ka')"
    with pytest.raises(ValueError, match="Goldstone DSS-13: band='L' must be one of S, X, Ka"):
        rp.Station(band="L")
    assert rp.Station(model=BiasModel.zero()).model == BiasModel.zero()
    assert station.model != BiasModel.zero()


def test_a_pass_over_another_station_is_refused_with_both_sites(passes: list[rp.StationPass]) -> None:
    other = rp.Station("leo_3m7")
    assert other.site != passes[0].station.site
    for use in (other.certificate, other.simulate, other.track, lambda one: other.certificates([one])):
        with pytest.raises(ValueError, match=r"is over Goldstone DSS-13 at 35.* deg north.*; passes of .* at .* its"):
            use(passes[0])


def test_passes_are_those_of_the_track_in_degrees(station: rp.Station, passes: list[rp.StationPass]) -> None:
    track, start_t_s = CBERS.track(station.site), from_utc_text(START)
    wanted = find_passes(track, start_t_s, 12.5 * 3600.0, station.rules.mask.above(math.radians(5.0)))
    assert [one.window for one in passes] == wanted
    for one in passes:
        assert from_utc_text(one.aos_utc) == pytest.approx(one.aos_t_s, abs=1e-3)
        assert one.aos_t_s < one.tca_t_s < one.los_t_s
        assert math.radians(one.peak_elevation_deg) == pytest.approx(one.window.peak_elevation_rad)
        assert one.values()["los_azimuth_deg"] == pytest.approx(math.degrees(one.window.los_azimuth_rad))
    high = station.passes(CBERS, start_t_s=start_t_s, hours=12.5, min_peak_rad=math.radians(30.0))
    assert [one.aos_utc for one in high] == [one.aos_utc for one in passes if one.peak_elevation_deg >= 30.0]
    # Without a start from the epoch on, for a day.
    assert station.passes(CBERS)[0].searched_from_t_s == CBERS.first_t_s
    above = station.passes(CBERS, start=START, hours=12.5, mask_deg=20.0)
    assert all(one.aos_elevation_deg == pytest.approx(20.0, abs=1e-3) for one in above)


def test_each_slew_begins_where_the_pass_before_has_left_the_axes(
    station: rp.Station, passes: list[rp.StationPass]
) -> None:
    first, *rest = station.certificates(passes)
    alone = station.certificate(passes[0])
    assert alone.values() == first.values()
    for before, certificate in zip([first, *rest], rest, strict=False):
        azimuth_rad, elevation_rad = before.chosen.end_rad
        # A certificate alone begins at the search; this one is free later, at the same angles.
        same = station.certificate(certificate.one, azimuth_rad=azimuth_rad, elevation_rad=elevation_rad)
        assert [branch.preposition_s for branch in same.certificate.branches] == pytest.approx(
            [branch.preposition_s for branch in certificate.certificate.branches], rel=0.05
        )
    assert all(each.accepted and each.sun_angle_deg > 1.0 for each in (first, *rest))
    assert first.reason == ""
    assert str(first).count("\n") >= 3


def test_a_pass_over_the_zenith_says_what_it_costs(passes: list[rp.StationPass], station: rp.Station) -> None:
    zenith = station.certificate(max(passes, key=lambda one: one.peak_elevation_deg))
    assert zenith.one.peak_elevation_deg == pytest.approx(89.9, abs=0.01)
    assert zenith.lost_s is not None
    assert zenith.lost_s > 10.0
    assert zenith.expected_loss_db is not None


def test_a_look_is_the_track_and_the_bias_model_at_that_time(station: rp.Station) -> None:
    look = station.look(CBERS, at=START)
    (at,) = [CBERS.track(station.site).sample([from_utc_text(START)])]
    assert look.t_s == from_utc_text(START)
    assert look.azimuth_deg == pytest.approx(math.degrees(at.azimuth_rad[0]))
    assert look.elevation_deg == pytest.approx(math.degrees(at.elevation_rad[0]))
    perfect = rp.Station(model=BiasModel.zero()).look(CBERS, at_t_s=look.t_s)
    assert (perfect.azimuth_correction_deg, perfect.elevation_correction_deg) == (0.0, 0.0)
    offset = BiasModel.zero().replace(elevation_offset=math.radians(0.1))
    assert rp.Station(model=offset).look(CBERS, at=START).elevation_correction_deg == pytest.approx(0.1)
    with pytest.raises(ValueError, match="at: give the time"):
        station.look(CBERS)


def test_a_slew_is_a_trapezoid_of_rate(station: rp.Station) -> None:
    """T = d / v + v / a for an axis that reaches its largest rate."""
    machine, turn_rad = station.rules.machine.axes, math.radians(90.0)
    found = station.slew_s(from_azimuth_deg=10.0, from_elevation_deg=45.0, to_azimuth_deg=100.0, to_elevation_deg=45.0)
    rate, acceleration = machine.rate_rad_s[0], machine.acceleration_rad_s2[0]
    assert found == pytest.approx(turn_rad / rate + rate / acceleration)
    with pytest.raises(ValueError, match="to_azimuth: give to_azimuth_deg or to_azimuth_rad"):
        station.slew_s(from_azimuth_deg=10.0, from_elevation_deg=45.0, to_elevation_deg=45.0)


def test_the_plan_of_many_has_the_passes_of_each_in_every_form(station: rp.Station) -> None:
    targets = [CBERS, rp.elements("DELTA 1 DEB", priority=3, min_peak_deg=10.0)]
    plan = station.plan(targets, start=START, hours=12.5, gap_s=10.0)
    mine = [row for row in plan.rows if row["catalogue_number"] == 28057]
    alone = station.passes(CBERS, start=START, hours=12.5)
    assert [row["aos_utc"][:22] for row in mine] == [one.aos_utc[:22] for one in alone]
    assert all(row["peak_elevation_deg"] >= 10.0 for row in plan.rows if row["priority"] == 3)
    assert json.loads(plan.to_json())["passes"] == plan.rows
    header, *lines = plan.to_csv().splitlines()
    assert (header.split(","), len(lines)) == (list(plan.rows[0]), len(plan.rows))
    assert len(str(plan).splitlines()) == len(plan.rows) + 2
    assert len(plan.tracked) == plan.to_calendar(1.8e9).count("BEGIN:VEVENT") > 0
    assert "stale elements of 1 tracked satellites" in plan.warning()
    assert plan.warning(stale_days=9.0) == ""
    assert plan.unsearched == {}
    # Old elements are planned from their newest epoch.
    assert station.plan([CBERS], hours=1.0).day.start_t_s == CBERS.first_t_s
    with pytest.raises(ValueError, match="at least one satellite"):
        station.plan([])
    mixed = station.plan([CBERS, rp.elements("Sun")], start=START, hours=12.5)
    assert {row["name"] for row in mixed.rows} == {"CBERS 2", "Sun"}


ODD, DECAY = ("odd", "2026-11-25T00:30:00"), ("decay", "2026-11-26T00:00:00")


@pytest.mark.parametrize(
    ("shipped", "name", "start"),
    [("geo_7m", *ODD), ("leo_3m7", *ODD), ("rotator_2m", *ODD), ("dss13", *DECAY), ("vhf_uhf_yagi", *DECAY)],
)
def test_a_pass_is_the_same_by_search_certificate_and_plan(shipped: str, name: str, start: str) -> None:
    """Always up, cut by the window, ended by the elements, past an end of the travel: one definition."""
    antenna, day = rp.Station(shipped), {"start": start, "hours": 8.0}
    targets = rp.catalogue(Path("test/ephemeris/data/orbits") / f"{name}.tle")
    plan = antenna.plan(targets, **day)
    for target in targets:
        alone, fates = antenna.passes(target, **day), []
        for row in (one for one in plan.rows if one["name"] == target.name):
            aos_s, los_s = (from_utc_text(row[key].rstrip("Z")) for key in ("aos_utc", "los_utc"))
            # A pass that lasts is flown in pieces, and joined when the antenna can be there.
            (whole,) = (each for each in alone if each.aos_t_s - 0.05 < aos_s and los_s < each.los_t_s + 0.05)
            fates.append((whole.aos_t_s, row["fate"]))
            assert (row["fate"] == "barred") <= (antenna.certificate(whole).chosen is None)
        assert {aos_s for aos_s, _ in fates} == {one.aos_t_s for one in alone}
        part = antenna.part_searched(target, start_t_s=from_utc_text(start), hours=8.0)
        assert plan.unsearched.get(target.name, "") == part


def test_a_calendar_keeps_rfc_5545_and_the_names(station: rp.Station, tmp_path: Path) -> None:
    from rf_pointing.ephemeris import find_elements, tle_lines, verification_elements

    odd = "CBERS 2; \u00c4\u00d6\u00dc, a name that is far longer than seventy-five octets of a line"
    (tmp_path / "odd.tle").write_text("\n".join((odd, *tle_lines(find_elements(verification_elements(), "28057")))))
    plan = station.plan(rp.catalogue(tmp_path / "odd.tle"), start=START, hours=12.5)
    lines = plan.to_calendar(1.8e9).encode().split(b"\r\n")
    assert max(map(len, lines)) <= 75
    assert b"\n" not in b"".join(lines)
    # Unfolded and unescaped by hand: what any calendar does.
    whole = plan.to_calendar(1.8e9).replace("\r\n ", "").split("\r\n")
    names = [line[8:].replace("\\;", ";").replace("\\,", ",") for line in whole if line.startswith("SUMMARY:")]
    assert names == [f"{odd}, peak {row['peak_elevation_deg']:.0f} deg" for row in plan.tracked]


def test_a_simulated_pass_is_held_to_a_thousandth_of_a_degree(station: rp.Station) -> None:
    (one,) = station.passes(CBERS, min_peak_deg=40.0)
    log = station.simulate(one, minutes=1.5, changes={"antenna_servo": {"wind.mean_speed_m_s": 0.0}})
    assert log.sensor == "monopulse"
    assert np.sqrt(np.mean(log.errors_mdeg("monopulse")[-200:] ** 2)) < 1.0
    assert max(log.rms_mdeg("monopulse")) < max(log.rms_mdeg("program_track"))
    errors = log.errors_mdeg()
    assert errors.shape == (len(log.log.t_s), 2)
    assert np.radians(errors / 1e3) == pytest.approx(log.log.errors_rad())
    assert sum(log.seconds.values()) == pytest.approx(0.1 * len(errors))
    assert set(map(len, log.table().values())) == {len(errors)}
    # The same seed gives the same pass, another one another.
    again, other = (station.simulate(one, minutes=0.05, sensor="program", seed=seed) for seed in (1, 2))
    assert again.errors_mdeg().tolist() != other.errors_mdeg().tolist()
    with pytest.raises(ValueError, match="no sample in conscan; there are"):
        log.rms_mdeg("conscan")
    # Its mean would be NaN, which tells nobody that the loop was unstable.
    cut = replace(log, log=PassLog(*[[0.0] * 3] * 3, mode=["slew"] * 3, fault="azimuth oscillates"))
    with pytest.raises(ValueError, match=r"there are slew 0\.3 s; the antenna stopped: azimuth oscillates"):
        cut.errors_mdeg("monopulse")
    with pytest.raises(ValueError, match="sensor=array: X band"):
        station.simulate(one, sensor="array")
