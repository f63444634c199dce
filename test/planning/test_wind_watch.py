"""High wind: gust, mean, hysteresis, and an anemometer that says nothing."""

import math

import numpy as np

from rf_pointing.planning import WindWatch, WindWatchParams

PARAMS = WindWatchParams(gust_limit_m_s=25.0, mean_limit_m_s=18.0, release_share=0.8, release_s=60.0, silence_s=5.0)


def blow(watch: WindWatch, start_s: float, seconds: float, speed: float) -> tuple[float, str]:
    for t_s in np.arange(start_s, start_s + seconds, 0.1).tolist():
        watch.take(t_s, speed)
        reason = watch.step(t_s)
    return start_s + seconds, reason


def test_a_spike_shorter_than_a_gust_is_no_high_wind_and_a_gust_is() -> None:
    watch = WindWatch(PARAMS)
    t_s, reason = blow(watch, 0.0, 30.0, 10.0)
    t_s, reason = blow(watch, t_s, 0.5, 40.0)
    assert reason == ""
    t_s, reason = blow(watch, t_s, 3.0, 30.0)
    assert reason.startswith("gust ")


def test_a_steady_wind_below_the_gust_limit_stows_by_its_mean() -> None:
    watch = WindWatch(PARAMS)
    t_s, reason = blow(watch, 0.0, 600.0, 10.0)
    t_s, reason = blow(watch, t_s, 300.0, 20.0)
    assert reason == ""
    t_s, reason = blow(watch, t_s, 170.0, 20.0)
    assert reason == "", "480 s of it make a mean of 18 m/s"
    _, reason = blow(watch, t_s, 15.0, 20.0)
    assert reason.startswith("10-min mean 18.")


def test_the_antenna_comes_out_only_after_a_minute_well_below() -> None:
    watch = WindWatch(PARAMS)
    t_s, _ = blow(watch, 0.0, 10.0, 26.0)
    t_s, reason = blow(watch, t_s, 590.0, 21.0)
    assert reason, "between release and limit it stays in"
    t_s, reason = blow(watch, t_s, 400.0, 5.0)
    t_s, reason = blow(watch, t_s, 100.0, 5.0)
    assert reason == ""


def test_silence_is_high_wind_and_so_is_nonsense() -> None:
    watch = WindWatch(PARAMS)
    assert "has not been heard" in watch.step(0.0)
    watch = WindWatch(PARAMS)
    t_s, reason = blow(watch, 0.0, 20.0, 3.0)
    assert reason == ""
    for step in range(60):
        watch.take(t_s + 0.1 * step, (math.nan, -1.0, 1e9)[step % 3])
    assert "silent for 5." in watch.step(t_s + 5.5)


def test_calm_must_last_for_the_release_time_and_begins_anew_with_every_gust() -> None:
    watch = WindWatch(PARAMS)
    t_s, _ = blow(watch, 0.0, 20.0, 5.0)
    t_s, reason = blow(watch, t_s, 4.0, 26.0)
    assert reason.startswith("gust ")
    t_s, reason = blow(watch, t_s, 40.0, 5.0)
    t_s, reason = blow(watch, t_s, 4.0, 26.0)
    # The 3-s mean is below 20 m/s after 0.9 s of it.
    t_s, reason = blow(watch, t_s, 60.5, 5.0)
    assert reason.startswith("gust ")
    _, reason = blow(watch, t_s, 1.0, 5.0)
    assert reason == ""
