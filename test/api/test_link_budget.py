"""The link budget as a table: along a pass it is what the simulated receiver counts with."""

import json
from pathlib import Path

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.commands.link_budget import main
from rf_pointing.core.dates import parse_utc
from rf_pointing.rf import Link


def test_along_a_pass_the_level_is_that_of_the_simulated_receiver_but_for_sun_and_moon() -> None:
    station, target = rp.Station("leo_3m7", "S"), rp.elements("CBERS 2")
    one = station.passes(target, days=1, min_peak_deg=20.0)[0]
    table = station.link_budget(one)
    signal = station.description.sets("rf_receiver", "S")["signal"]
    look = station.track_of(target).sample([parse_utc(each) for each in table.utc])
    level = Link(signal.link, signal.atmosphere, signal.noise).carrier_to_noise_db_hz(look.range_m, look.elevation_rad)
    columns = table.columns
    clear_k = columns["system_k"] - columns["sun_k"] - columns["moon_k"]
    expected = level - 10.0 * np.log10(columns["system_k"] / clear_k)
    np.testing.assert_allclose(columns["carrier_to_noise_db_hz"], expected, atol=1e-4)
    assert columns["system_k"].min() == pytest.approx(150.0, rel=0.1)


def test_a_pass_through_the_sun_has_it_in_the_beam() -> None:
    """The target is the Sun itself: on the axis of a 2.4-deg beam all the time it is up."""
    station, sun = rp.Station("leo_3m7", "S"), rp.elements("Sun")
    one = station.passes(sun, start="2026-06-21T02:00:00", hours=4)[0]
    noise = station.link_budget(one).columns["sun_k"]
    assert noise.min() > 100.0


def test_the_command_prints_json_and_draws(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    picture = tmp_path / "budget.png"
    main(["--station", "dss13", "--band", "Ka", "--json", "--picture", str(picture)])
    found = json.loads(capsys.readouterr().out)
    assert found["title"] == "Goldstone DSS-13, Ka band, over elevation"
    # docs/math/link.md: 103 K at 10 deg, 66 K at the zenith.
    rows = dict(zip(found["elevation_deg"], found["system_k"], strict=True))
    assert rows[10.0] == pytest.approx(103.0, abs=0.7)
    assert rows[90.0] == pytest.approx(66.0, abs=0.7)
    assert picture.read_bytes().startswith(b"\x89PNG")
