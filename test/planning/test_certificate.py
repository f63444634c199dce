"""Certificates: exact plunge, turns within the travel, refusals with their numbers."""

import dataclasses
import json
import math

import numpy as np
import pytest

from rf_pointing.core import angular_distance_rad
from rf_pointing.planning import (
    AxisLimits,
    Branch,
    Certificate,
    HorizonMask,
    MachineParams,
    PassProfile,
    SensorCost,
    certificate_lines,
    certificate_values,
    certify,
    plunged,
    unplunged,
)

DEG = math.pi / 180.0
MACHINE = MachineParams()


def arc(low_deg: float, high_deg: float, peak_deg: float = 50.0, seconds: float = 600.0) -> PassProfile:
    """A smooth pass between two azimuths; the Sun is at the nadir."""
    t = np.linspace(0.0, seconds, round(seconds / 0.1) + 1)
    phase = math.pi * t / seconds
    w = math.pi / seconds
    azimuth = 0.5 * (low_deg + high_deg) - 0.5 * (high_deg - low_deg) * np.cos(phase)
    elevation = 5.0 + (peak_deg - 5.0) * np.sin(phase)
    columns = (
        (azimuth, elevation),
        (0.5 * (high_deg - low_deg) * w * np.sin(phase), (peak_deg - 5.0) * w * np.cos(phase)),
        (0.5 * (high_deg - low_deg) * w**2 * np.cos(phase), -(peak_deg - 5.0) * w**2 * np.sin(phase)),
    )
    position, velocity, acceleration = (np.column_stack(pair) * DEG for pair in columns)
    return PassProfile(
        name="bird", t_s=1000.0 + t, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration,
        sun_rad=np.tile([0.0, -90.0 * DEG], (len(t), 1)), range_m=np.full(len(t), 1e6), satellite_gain_db=np.zeros(len(t)),
    )  # fmt: skip


def certificate(
    profile: PassProfile, limits: AxisLimits | None = None, mask: HorizonMask | None = None,
    machine: MachineParams = MACHINE, present_deg: tuple[float, float] = (120.0, 60.0),
    now_s: float = 0.0, cost: SensorCost | None = None,
) -> Certificate:  # fmt: skip
    motion = (profile.position_rad, profile.velocity_rad_s, profile.acceleration_rad_s2)
    return certify(
        profile, {False: motion, True: plunged(*motion)}, now_s, (present_deg[0] * DEG, present_deg[1] * DEG), machine,
        limits or AxisLimits(), mask or HorizonMask(),
        lambda error: np.exp(-2.77 * (error / machine.half_power_beamwidth_rad) ** 2), cost=cost,
    )  # fmt: skip


def test_the_plunge_is_the_same_direction_at_every_instant(random: np.random.Generator) -> None:
    position = random.uniform([-7.0, -0.2], [7.0, 1.5], (50, 2))
    zero = np.zeros_like(position)
    over = plunged(position, zero, zero)[0]
    np.testing.assert_allclose(over, np.column_stack([position[:, 0] + math.pi, math.pi - position[:, 1]]))
    assert np.max(angular_distance_rad(*position.T, *over.T)) < 1e-12
    rates = random.normal(size=(50, 2))
    for back, was in zip(unplunged(*plunged(position, rates, rates)), (position, rates, rates), strict=True):
        np.testing.assert_allclose(back, was, atol=1e-12)


def test_the_turn_with_the_least_slewing_before_and_after_is_taken() -> None:
    """From 120 deg the near turn is there at once, but has to unwind after; the far one needs the time before."""
    far = certificate(arc(150.0, 200.0)).chosen
    assert (far.turns, far.unwind_s) == (-1, 0.0)
    hurried = certificate(arc(150.0, 200.0), now_s=900.0).chosen
    assert (hurried.turns, hurried.late_s) == (0, 0.0)
    assert certificate(arc(100.0, 170.0)).chosen.turns == 0


def test_the_margin_is_that_of_the_closest_limit() -> None:
    chosen = certificate(arc(50.0, 167.0)).chosen
    assert chosen.closest_limit == "elevation 4.0 deg"
    assert chosen.limit_margin_rad == pytest.approx(1.0 * DEG)
    narrow = AxisLimits(azimuth_max_rad=167.5 * DEG)
    chosen = certificate(arc(50.0, 167.0), narrow).chosen
    assert (chosen.closest_limit, chosen.limit_margin_rad) == ("azimuth 167.5 deg", pytest.approx(0.5 * DEG))


def test_a_machine_with_plunge_takes_it_where_the_turns_do_not_reach() -> None:
    narrow = AxisLimits(azimuth_min_rad=-100.0 * DEG, azimuth_max_rad=100.0 * DEG, elevation_max_rad=176.0 * DEG)
    chosen = certificate(arc(110.0, 250.0), narrow).chosen
    assert chosen.plunge
    assert chosen.start_rad == (pytest.approx(-70.0 * DEG), pytest.approx(175.0 * DEG))
    assert chosen.end_rad[0] == pytest.approx(70.0 * DEG)


def test_without_a_branch_the_refusal_says_by_how_much() -> None:
    narrow = AxisLimits(azimuth_min_rad=-100.0 * DEG, azimuth_max_rad=100.0 * DEG)
    found = certificate(arc(90.0, 130.0), narrow)
    assert found.chosen is None
    assert "waits: 400 s of 600 s would be lost, 33 % received, must be >= 80 %" in found.reason
    reasons = [branch.reasons for branch in found.branches if branch.crossing is None]
    assert ("30.000 deg past the limit azimuth 100.0 deg",) in reasons
    assert certificate_lines(found)[-1] == f"REFUSED: {found.reason}"


def test_a_pass_behind_the_horizon_is_refused_with_the_angle() -> None:
    hill = HorizonMask(azimuth_rad=(0.0, 1.9, 2.0, 2.1), elevation_rad=(0.0, 0.0, 60.0 * DEG, 0.0))
    found = certificate(arc(60.0, 180.0), mask=hill)
    assert "deg below the horizon mask" in found.reason
    assert found.branches[0].mask_margin_rad < -5.0 * DEG


def test_a_pass_through_the_sun_is_refused_with_the_angle() -> None:
    profile = arc(60.0, 180.0)
    middle = profile.position_rad[len(profile.t_s) // 2] + np.array([0.0, 0.4 * DEG])
    sunny = dataclasses.replace(profile, sun_rad=np.tile(middle, (len(profile.t_s), 1)))
    assert "0.400 deg from the Sun, must be >= 1.050 deg" in certificate(sunny).reason
    assert certificate(sunny, machine=MACHINE.replace(sun_radius_rad=0.0)).chosen is not None


def test_the_sun_is_kept_from_where_a_detour_leads_not_from_the_target_alone() -> None:
    """Too fast for the azimuth axis the beam turns aside by tens of degrees, and there stands the Sun."""
    profile = arc(10.0, 190.0, peak_deg=89.0, seconds=120.0)
    machine = MACHINE.replace(least_share=0.0)
    clear = certificate(profile, machine=machine).chosen
    assert clear is not None
    aside = int(np.argmax(clear.crossing.error_rad))
    beam = clear.crossing.position_rad[aside]
    sunny = dataclasses.replace(profile, sun_rad=np.tile(beam, (len(profile.t_s), 1)))
    assert float(np.min(sunny.sun_angle_rad())) > 3.0 * machine.sun_radius_rad
    refused = next(one for one in certificate(sunny, machine=machine).branches if one.label == clear.label)
    assert any("deg from the Sun" in reason for reason in refused.reasons)


def test_prepositioning_counts_against_the_pass_when_it_comes_too_late() -> None:
    early = certificate(arc(-60.0, 0.0), now_s=0.0).chosen
    assert early.late_s == 0.0
    # 180 deg at 1.8 deg/s, 2.25 s to accelerate at 0.8 deg/s^2.
    assert early.preposition_s == pytest.approx(180.0 / 1.8 + 2.25, rel=1e-3)
    late = certificate(arc(-60.0, 0.0), now_s=995.0).chosen
    assert late.late_s == pytest.approx(early.preposition_s - 5.0)
    assert "would be lost" in certificate(arc(-60.0, 0.0, seconds=200.0), now_s=995.0).reason


def test_in_the_middle_of_a_pass_the_way_is_to_where_it_has_come() -> None:
    """At 1300 s, half way through; the axes stand on the turn below."""
    found = certificate(
        arc(150.0, 200.0), machine=MACHINE.replace(least_share=0.0), present_deg=(-175.0, 50.0), now_s=1300.0
    ).chosen
    assert found.turns == -1
    assert found.preposition_s == pytest.approx(10.0 / 1.8 + 2.25, rel=1e-2)


@pytest.mark.parametrize("gone", [0.18, 0.5, 0.9])
def test_a_pass_is_worth_what_is_left_of_it(gone: float) -> None:
    """The slew of 7.8 s is late for it, whatever the share of the whole pass; only after its end nothing is left."""
    profile = arc(150.0, 200.0)
    now_s = 1000.0 + gone * 600.0
    here = np.degrees(profile.position_rad[round(gone * 6000)])
    found = certificate(profile, present_deg=(here[0] - 10.0, here[1]), now_s=now_s)
    chosen = found.chosen
    assert chosen is not None, found.reason
    assert chosen.late_s == pytest.approx(10.0 / 1.8 + 2.25, abs=0.1)
    assert chosen.start_rad == pytest.approx(np.radians(here).tolist(), abs=1e-6)
    assert chosen.mean_loss_db == pytest.approx(-10.0 * math.log10(1.0 - chosen.late_s / (1600.0 - now_s)), abs=0.01)


def test_a_pass_that_ends_before_the_axes_arrive_is_refused_in_words() -> None:
    assert (
        "the slew to the pass takes 91 s, 30 s of it are left"
        in certificate(arc(150.0, 200.0), present_deg=(40.0, 50.0), now_s=1570.0).reason
    )
    with pytest.raises(ValueError, match="the pass of bird ended 10 s ago"):
        certificate(arc(150.0, 200.0), now_s=1610.0)


def test_what_lies_behind_does_not_rule_out_the_rest() -> None:
    hill = HorizonMask(azimuth_rad=(0.0, 1.9, 2.0, 2.1), elevation_rad=(0.0, 0.0, 60.0 * DEG, 0.0))
    assert certificate(arc(60.0, 180.0), mask=hill).chosen is None
    assert certificate(arc(60.0, 180.0), mask=hill, now_s=1400.0, present_deg=(130.0, 45.0)).chosen is not None


def test_the_expected_loss_is_that_of_lateness_acquisition_and_scan() -> None:
    cost = SensorCost(acquisition_s=12.0, power=0.98)
    plain, late = (certificate(arc(150.0, 200.0), now_s=at, cost=cost).chosen for at in (0.0, 985.0))
    assert (plain.acquisition_s, plain.lost_s, plain.late_s) == (12.0, 0.0, 0.0)
    assert plain.mean_loss_db == pytest.approx(-10.0 * math.log10(0.98 * 588.0 / 600.0), abs=1e-4)
    received_s = 0.98 * (600.0 - 12.0 - late.late_s)
    assert late.late_s > 5.0
    assert late.mean_loss_db == pytest.approx(-10.0 * math.log10(received_s / 600.0), abs=1e-3)


@pytest.mark.parametrize("fixed_deg", [-5.0, 20.0, 50.0, 60.0])
def test_an_antenna_that_turns_in_azimuth_alone_loses_what_its_beam_does_not_reach(fixed_deg: float) -> None:
    profile, wide = arc(150.0, 200.0), MACHINE.replace(half_power_beamwidth_rad=50.0 * DEG, least_share=0.0)
    found = certificate(profile, machine=wide.replace(fixed_elevation_rad=(fixed_deg * DEG,)))
    share = np.exp(-2.77 * ((profile.position_rad[:, 1] - fixed_deg * DEG) / (50.0 * DEG)) ** 2)
    received = float(np.mean(np.maximum(share, 1e-2)))
    assert found.chosen.mean_loss_db == pytest.approx(-10.0 * math.log10(received), abs=0.02)
    assert found.chosen.lost_s == pytest.approx(0.1 * np.sum(share < 0.5), abs=0.2)
    assert f"elevation fixed at {fixed_deg:.1f} deg" in certificate_lines(found)[-1]
    behind = wide.replace(fixed_elevation_rad=(120.0 * DEG,), least_share=0.5)
    assert "600 s of 600 s would be lost" in certificate(profile, machine=behind).reason


def test_a_long_crossing_costs_the_acquisition_twice() -> None:
    fast, machine = arc(10.0, 190.0, peak_deg=89.0, seconds=120.0), MACHINE.replace(least_share=0.0)
    for memory_s, times in ((math.inf, 1.0), (1.0, 2.0)):
        chosen = certificate(fast, machine=machine, cost=SensorCost(acquisition_s=5.0, memory_s=memory_s)).chosen
        assert chosen.lost_s > 1.0
        assert chosen.acquisition_s == 5.0 * times


def test_unwinding_is_the_way_back_to_the_turn_about_north() -> None:
    assert certificate(arc(100.0, 170.0)).chosen.unwind_s == 0.0
    wound = certificate(arc(150.0, 210.0), now_s=900.0).chosen
    assert wound.unwind_s == pytest.approx(360.0 / 1.8 + 2.25, rel=1e-3)


def test_the_values_are_plain_json_in_degrees() -> None:
    values = json.loads(json.dumps(certificate_values(certificate(arc(100.0, 170.0)))))
    assert values["accepted"]
    taken = next(branch for branch in values["branches"] if branch["chosen"])
    assert taken["start_deg"] == pytest.approx([100.0, 5.0])
    assert taken["refusals"] == []
    assert values["machine"]["reserve"] == 0.05


def branch(**changes: object) -> Branch:
    """One that works, made by hand."""
    values: dict[str, object] = {
        "turns": 1, "plunge": False, "over": False, "start_rad": (0.5, 0.1), "end_rad": (7.0, 0.2),
        "azimuth_range_rad": (0.1, 7.1), "elevation_range_rad": (0.05, 1.2), "peak_rate_rad_s": (0.02, 0.01),
        "peak_acceleration_rad_s2": (0.001, 0.002), "closest_limit": "azimuth 220.0 deg", "limit_margin_rad": 0.3,
        "mask_margin_rad": 0.04, "sun_margin_rad": 1.2, "keyhole_s": 0.0, "lost_s": 0.0, "lost_signal_s": 0.0,
        "peak_loss_db": 0.0, "mean_loss_db": 0.25, "preposition_s": 41.0, "unwind_s": 202.0, "late_s": 0.0,
        "acquisition_s": 0.0, "reasons": (),
    }  # fmt: skip
    return Branch(**{**values, **changes})  # type: ignore[arg-type]


def with_branches(*branches: Branch, cn0: tuple[float, ...] = ()) -> Certificate:
    return Certificate(
        name="bird", issued_t_s=0.0, aos_t_s=10.0, los_t_s=20.0, sky_peak_rad=1.2, branches=branches, machine=MACHINE,
        carrier_to_noise_db_hz=cn0,
    )  # fmt: skip


def test_a_crossing_moves_with_its_branch_by_whole_turns() -> None:
    found = certificate(arc(10.0, 190.0, peak_deg=89.0, seconds=120.0), machine=MACHINE.replace(least_share=0.0))
    seen = set()
    for one in found.branches:
        if one.plunge or one.over:
            continue
        seen.add(one.turns)
        first = round((one.crossing.t_s[0] - 1000.0) / 0.1)
        part = one.axes_rad[first : first + len(one.crossing.t_s)]
        np.testing.assert_allclose(one.crossing.position_rad, part, atol=1e-12)
        assert one.start_rad[0] == pytest.approx(10.0 * DEG + 2.0 * math.pi * one.turns)
    assert seen == {-1, 0}


def test_the_verdict_says_all_that_is_expected_of_the_pass() -> None:
    plain = "taken: direct, +1 turns, start at azimuth 28.6 deg; expected pointing loss 0.25 dB"
    assert certificate_lines(with_branches(branch()))[-1] == plain
    cross = "; crosses the zenith at its limits: {} s off target, {} s below half power, up to {} dB"
    for changes, words in (
        ({"keyhole_s": 0.5, "lost_s": 0.3, "peak_loss_db": 4.0}, cross.format("0.5", "0.3", "4.0")),
        ({"keyhole_s": 9.0, "lost_s": 8.0, "peak_loss_db": 40.0}, cross.format("9.0", "8.0", "more than 40.0")),
        ({"late_s": 0.6}, "; arrives 1 s after acquisition"),
        ({"acquisition_s": 0.7}, "; 1 s expected until a sensor holds the target"),
    ):
        said = certificate_lines(with_branches(branch(**changes)))[-1]
        assert said == plain.replace("; expected", f"{words}; expected")
    assert certificate_lines(with_branches(branch(), cn0=(40.0, 52.5)))[-1] == f"{plain}, C/N0 40.0 to 52.5 dB-Hz"
