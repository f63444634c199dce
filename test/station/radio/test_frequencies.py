"""Doppler of a radio: skyfield as independent library, the transponder, converters, steps."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.ephemeris import (
    SITES,
    TopocentricTrack,
    find_elements,
    find_passes,
    verification_elements,
)
from rf_pointing.station.description.content import RigSection, TransponderSection
from rf_pointing.station.radio.control import LONGEST_WAIT_S
from rf_pointing.station.radio.frequencies import Channel, Dial, Motion
from skyfield.api import EarthSatellite, load, wgs84
from test.station.radio.targets import target

SITE = SITES["Goldstone DSS-13"]
LOW_ORBITS = ("28057", "06251", "29238")
HZ = 1.0


@cache
def passes() -> list[tuple[TopocentricTrack, str, float, float]]:
    """Return 20 passes of low satellites with rise and set."""
    found = []
    for number in LOW_ORBITS:
        elements = find_elements(verification_elements(), number)
        track = TopocentricTrack(elements, SITE)
        windows = find_passes(
            track, elements.epoch_t_s, 2.5 * 86400.0, lambda azimuth: 0.0 * azimuth
        )
        found += [(track, number, each.aos_t_s, each.los_t_s) for each in windows]
    return found[:20]


def motion(track: TopocentricTrack, t_s: float) -> Motion:
    """Return what the radio knows at a time: messages every 0.1 s, until 2 s ahead."""
    known = Motion()
    for step in range(-3, 21):
        known.take(track.target_at(math.floor(10.0 * t_s) / 10.0 + 0.1 * step))
    return known


def test_frequencies_agree_with_skyfields_range_rate_on_twenty_passes() -> None:
    """The range rate of skyfield is that of one moment; light time is 0.3 Hz at 437 MHz, and is in the other rows."""
    scale, place = load.timescale(builtin=True), wgs84.latlon(
        math.degrees(SITE.latitude_rad), math.degrees(SITE.longitude_rad), elevation_m=SITE.altitude_m
    )  # fmt: skip
    lines = {line[2:7]: line for line in _lines("1 ")}, {line[2:7]: line for line in _lines("2 ")}
    flown = passes()
    assert len(flown) == 20
    worst = 0.0
    for track, number, aos_s, los_s in flown:
        satellite = EarthSatellite(lines[0][number], lines[1][number], number, scale)
        times = np.linspace(aos_s + 1.0, los_s - 1.0, 7) + 0.037
        at = scale.utc(1970, 1, 1 + times // 86400.0, 0, 0, times % 86400.0)
        *_, rate = (satellite - place).at(at).frame_latlon_and_rates(place)[2:]
        q = rate.m_per_s / SPEED_OF_LIGHT_M_S
        shifts = [motion(track, t_s).at(t_s) for t_s in times.tolist()]
        assert all(each is not None for each in shifts)
        down = [437.8e6 * each.down for each in shifts if each]
        up = [145.9e6 * each.up for each in shifts if each]
        worst = max(
            worst, np.abs(down - 437.8e6 * (1.0 - q)).max(), np.abs(up - 145.9e6 * (1.0 + q)).max()
        )
    print(f"20 passes: at most {worst:.2f} Hz from skyfield")
    assert worst < HZ


def _lines(kind: str) -> list[str]:
    import sgp4

    text = (Path(sgp4.__file__).parent / "SGP4-VER.TLE").read_text()
    return [line[:69] for line in text.splitlines() if line.startswith(kind)]


def test_what_is_sent_arrives_at_the_frequency_of_the_satellite() -> None:
    """A phase that leaves at t arrives at t + tau: cycles are counted at both ends, at 2.2 GHz."""
    track, _, aos_s, los_s = passes()[0]
    seen = TopocentricTrack(track.target, SITE, light_time="transmit")
    t_s = 0.5 * (aos_s + los_s) + 0.04
    tau = (
        np.array([seen.target_at(t_s + step).range_m for step in (-0.05, 0.05)])
        / SPEED_OF_LIGHT_M_S
    )
    arriving = (0.1 + np.diff(tau)[0]) / 0.1
    shifts = motion(track, t_s).at(t_s)
    assert shifts is not None
    assert 2.2e9 * shifts.up / arriving == pytest.approx(2.2e9, abs=HZ)


def test_updates_at_1_ghz_are_at_most_10_hz_apart_in_every_pass() -> None:
    dial, largest = Dial(RigSection()), 0.0
    for track, _, aos_s, los_s in passes():
        look = track.sample(np.arange(aos_s, los_s, 1.0))
        steepest_s = float(look.t_s[np.argmax(np.abs(np.gradient(look.range_rate_m_s)))])
        known = motion(track, steepest_s)
        tuned = [
            dial.of(1e9 * shifts.down)
            for step in range(80)
            if (shifts := known.at(steepest_s + LONGEST_WAIT_S * step))
        ]
        largest = max(largest, float(np.abs(np.diff(tuned)).max()))
    print(f"at 1 GHz at most {largest:.1f} Hz from update to update")
    assert 1.0 < largest <= 10.0


@given(
    st.floats(-3e4, 3e4), st.booleans(), st.floats(1e8, 4e9), st.sampled_from([0.0, 100.0, 1.0e3, 9750.0]),
    st.floats(-1e5, 1e5),
)  # fmt: skip
def test_a_transponder_and_a_converter_are_undone_by_their_inverses(
    above_hz: float, inverting: bool, frequency_hz: float, oscillator_mhz: float, offset_hz: float
) -> None:
    channel = Channel.of(
        TransponderSection(
            downlink_mhz=435.64, uplink_mhz=145.965, passband_khz=60.0, inverting=inverting
        )
    )
    uplink_hz = channel.uplink_hz(above_hz)
    assert uplink_hz is not None
    assert channel.above_hz(uplink_hz) == pytest.approx(above_hz, abs=1e-6)
    assert (uplink_hz - 145.965e6) * above_hz * (-1 if inverting else 1) >= 0.0
    dial = Dial(RigSection(oscillator_mhz=oscillator_mhz, offset_hz=offset_hz, step_hz=1.0))
    assert dial.frequency_hz(dial.of(frequency_hz), frequency_hz) == pytest.approx(
        frequency_hz, abs=0.56
    )


def test_an_ku_band_lnb_and_a_transverter_above_the_signal() -> None:
    """10 489.55 MHz behind an LNB of 9750 MHz that is 2 kHz high is 739.55 MHz less 2 kHz."""
    dial = Dial(RigSection(oscillator_mhz=9750.0, offset_hz=-2000.0))
    assert dial.of(10489.55e6) == 739.548e6
    assert Dial(RigSection(oscillator_mhz=1750.0)).of(1691.0e6) == 59.0e6
    assert Dial(RigSection(step_hz=10.0)).of(145_900_007.0) == 145_900_010.0


def test_a_time_before_the_first_and_after_the_last_message_is_not_known_and_another_satellite_begins_anew() -> (
    None
):
    known = Motion()
    assert known.at(10.0) is None
    for t_s in (10.0, 10.1, 10.2):
        known.take(target(t_s, rate_m_s=7000.0))
    assert known.at(9.99) is None
    assert known.at(10.21) is None
    shifts = known.at(10.05)
    assert shifts is not None
    assert shifts.down == pytest.approx(1.0 - 7000.0 / SPEED_OF_LIGHT_M_S, abs=1e-15)
    # A publisher that starts again repeats a time, with a newer rate; over a gap nothing is known.
    known.take(target(10.2, rate_m_s=6000.0))
    shifts = known.at(10.15)
    assert shifts is not None
    assert shifts.down == pytest.approx(1.0 - 6500.0 / SPEED_OF_LIGHT_M_S, abs=1e-15)
    known.take(target(11.3))
    assert known.at(11.0) is None
    known.take(target(11.2, "B"))
    assert known.at(10.15) is None
    assert known.name == "B"
