"""The autotrack table: every row fires, and carrier loss freezes at once."""

import math
from pathlib import Path

import pytest

from rf_pointing.core import Mode
from rf_pointing.tracking import Autotrack, AutotrackInputs, AutotrackParams, AutotrackState
from rf_pointing.tracking.autotrack import TRANSITIONS

TICK_S = 0.1


class Driver:
    """Runs the table tick by tick and remembers the modes it went through."""

    def __init__(self, **params: object) -> None:
        self.table = Autotrack(AutotrackParams(**params))
        self.state = AutotrackState()
        self.modes = ["idle"]
        self.t_s = 0.0

    def run(
        self, seconds: float, level_db_hz: float = -math.inf, monopulse_valid: bool = False,
        conscan_valid: bool = True, **inputs: object,
    ) -> str:  # fmt: skip
        sensors = {"monopulse": monopulse_valid, "conscan": conscan_valid}
        valid = frozenset(name for name, usable in sensors.items() if usable)
        values = {"request": "track", "target_available": True, "on_target": True, "valid": valid, **inputs}
        for _ in range(max(round(seconds / TICK_S), 1)):
            self.t_s += TICK_S
            given = AutotrackInputs(t_s=self.t_s, carrier_to_noise_db_hz=level_db_hz, **values)
            self.state = self.table.step(self.state, given)
            if self.state.mode != self.modes[-1]:
                self.modes.append(self.state.mode)
        return self.state.mode

    def searching(self, **state: bool) -> "Driver":
        """Go on in a search that hears a strong carrier."""
        self.state = AutotrackState(mode="search", carrier=True, strong=True, **state)
        return self

    def on_monopulse(self) -> "Driver":
        assert self.run(2.0, 50.0, monopulse_valid=True) == "monopulse"
        return self


def test_pass_with_a_strong_carrier_goes_straight_to_monopulse_and_ends_idle() -> None:
    driver = Driver()
    driver.run(1.0, on_target=False)
    driver.run(2.0, 50.0, monopulse_valid=True)
    driver.run(0.2, 50.0, monopulse_valid=True, target_available=False)
    assert driver.modes == ["idle", "slew", "program_track", "monopulse", "idle"]
    assert driver.state.reason == "the target is no longer available"


def test_carrier_loss_freezes_within_one_tick_coasts_5_s_then_searches() -> None:
    driver = Driver().on_monopulse()
    assert driver.state.integrating
    driver.run(TICK_S, 5.0)
    assert driver.state.mode == "coast"
    assert not driver.state.integrating
    assert driver.run(4.9, 5.0) == "coast"
    assert driver.run(0.3, 5.0) == "search"


def test_carrier_that_returns_while_coasting_is_tracked_again_after_it_lasted() -> None:
    driver = Driver().on_monopulse()
    driver.run(2.0, 5.0)
    driver.run(TICK_S, 50.0, monopulse_valid=True)
    assert driver.state.mode == "coast"
    assert driver.run(0.5, 50.0, monopulse_valid=True) == "monopulse"


def test_gates_have_hysteresis() -> None:
    driver = Driver().on_monopulse()
    assert driver.run(1.0, 33.0, monopulse_valid=True) == "monopulse"
    assert driver.run(1.0, 31.0, monopulse_valid=True) == "conscan"
    assert driver.run(1.0, 35.0, monopulse_valid=True) == "conscan"
    assert driver.run(1.0, 37.0, monopulse_valid=True) == "monopulse"
    assert driver.run(1.0, 19.0) == "conscan"
    assert driver.run(0.2, 17.0) == "coast"
    assert driver.run(1.0, 21.0) == "coast"
    assert driver.run(1.0, 23.0) == "conscan"


def test_sensor_fault_hands_back_for_the_hold_time() -> None:
    driver = Driver().on_monopulse()
    driver.run(TICK_S, 50.0, monopulse_valid=True, fault="sign flip")
    assert driver.state.mode == "hand_back"
    assert driver.state.reason == "sign flip"
    assert not driver.state.integrating
    assert driver.run(4.8, 50.0, monopulse_valid=True) == "hand_back"
    assert driver.run(0.5, 50.0, monopulse_valid=True) == "monopulse"


def hand_back_twice(driver: Driver) -> Driver:
    for _ in range(2):
        assert driver.run(6.0, 50.0, monopulse_valid=True) == "monopulse"
        assert driver.run(TICK_S, 50.0, monopulse_valid=True, fault="sign flip") == "hand_back"
    return driver


def test_after_two_false_locks_auto_tracks_with_conscan_until_the_feed_is_calibrated() -> None:
    driver = hand_back_twice(Driver().on_monopulse())
    assert driver.run(6.0, 50.0, monopulse_valid=True) == "conscan"
    assert driver.run(600.0, 50.0, monopulse_valid=True) == "conscan"
    assert driver.run(TICK_S, 50.0, monopulse_valid=True, request="calibrate") == "calibrate"
    assert driver.run(27.0, 50.0, monopulse_valid=True) == "monopulse"


def test_a_sensor_that_was_chosen_is_tried_again_however_often_it_locked_wrongly() -> None:
    driver = hand_back_twice(Driver(sensor="monopulse").on_monopulse())
    assert driver.run(6.0, 50.0, monopulse_valid=True) == "monopulse"


def test_nobody_searches_while_no_sensor_reports() -> None:
    """A receiver that was stopped for 10 s: the ephemeris holds the beam, a search would lose it unseen."""
    driver = Driver().on_monopulse()
    assert driver.run(60.0, heard=False) == "coast"
    assert driver.run(0.2) == "search"
    silent = Driver()
    assert silent.run(60.0, heard=False) == "program_track"
    assert silent.run(0.2) == "search"
    back = Driver(sensor="conscan")
    assert back.run(2.0, 50.0) == "conscan"
    assert back.run(10.0, heard=False) == "coast"
    assert back.run(1.0, 50.0) == "conscan"
    assert "search" not in back.modes


@pytest.mark.parametrize(("link_db_hz", "mode"), [(31.0, "coast"), (40.0, "search"), (-math.inf, "search")])
def test_a_carrier_that_is_as_weak_as_the_link_is_not_searched_for(link_db_hz: float, mode: str) -> None:
    """Too weak for monopulse, 1 dB below the link's: the target is in the beam; 10 dB below it is not."""
    driver = Driver(sensor="monopulse").on_monopulse()
    assert driver.run(6.5, 30.0, axis_db_hz=link_db_hz) == mode
    assert mode == "search" or driver.run(60.0, 30.0, axis_db_hz=link_db_hz) == "coast"


def test_search_without_monopulse_returns_to_the_peak_one_turn_after_it() -> None:
    driver = Driver(sensor="conscan")
    driver.run(5.0)
    assert driver.state.mode == "search"
    for level in (24.0, 26.0, 30.0, 29.0, 20.0):
        driver.run(2.0 * TICK_S, level)
        assert driver.state.mode == "search"
    assert driver.state.peak_db_hz == 30.0
    peak_s = driver.state.peak_s
    assert peak_s == pytest.approx(driver.t_s - 5.0 * TICK_S, abs=1e-9)
    assert driver.run(7.0, 25.0) == "search"
    assert driver.run(1.0) == "coast"
    assert driver.state.peak_s == peak_s
    assert driver.run(1.0, 29.0) == "conscan"


def test_a_satellite_that_comes_nearer_does_not_keep_the_search_going() -> None:
    """Turns of 8 s through the target, 0.05 dB/s nearer: measured on the 3.7-m dish, which searched for 60 s."""
    driver = Driver(sensor="conscan", search_turn_s=8.0)
    driver.run(3.5, axis_db_hz=52.0)
    assert driver.state.mode == "search"
    begun_s = driver.t_s
    while driver.state.mode == "search" and driver.t_s - begun_s < 30.0:
        link_db_hz = 52.0 + 0.05 * (driver.t_s - begun_s)
        off = math.sin(2.0 * math.pi * (driver.t_s - begun_s) / 8.0)
        driver.run(TICK_S, link_db_hz - 4.0 * off**2, axis_db_hz=link_db_hz)
    assert driver.state.mode == "coast"
    assert driver.t_s - begun_s < 8.0 + 4.0 + 0.5


def test_search_that_saw_only_noise_goes_on() -> None:
    driver = Driver(sensor="conscan")
    driver.run(5.0)
    driver.run(0.2, 21.0)
    assert driver.run(10.0) == "search"


def test_conscan_errors_that_stay_invalid_start_a_search() -> None:
    driver = Driver(sensor="conscan")
    assert driver.run(2.0, 30.0) == "conscan"
    assert driver.run(0.9, 30.0, conscan_valid=False) == "conscan"
    assert driver.run(0.4, 30.0, conscan_valid=False) == "search"


@pytest.mark.parametrize(("sensor", "mode"), [
    ("conscan", "conscan"), ("steptrack", "steptrack"), ("none", "program_track"), ("monopulse", "monopulse"),
])  # fmt: skip
def test_chosen_sensor_is_the_one_used(sensor: str, mode: str) -> None:
    driver = Driver(sensor=sensor)
    assert driver.run(20.0, 50.0, monopulse_valid=True) == mode


@pytest.mark.parametrize("mode", Mode)
def test_idle_is_reached_from_every_mode_in_one_tick(mode: str) -> None:
    inputs = AutotrackInputs(t_s=1.0, request="idle", target_available=True, on_target=True)
    assert Autotrack(AutotrackParams()).step(AutotrackState(mode=mode), inputs).mode == "idle"


def test_every_mode_can_be_entered_and_left() -> None:
    assert {row.target for row in TRANSITIONS} == set(Mode)
    assert {source for row in TRANSITIONS for source in row.sources} == set(Mode)


def transition_table() -> str:
    """Return the table as Markdown, in order of priority."""
    rows = [f"| {', '.join(row.sources)} | {row.target} | {row.when} |" for row in TRANSITIONS]
    return "\n".join(["| from | to | when |", "|---|---|---|", *rows])


def transition_diagram() -> str:
    """Return the table as a Mermaid state diagram."""
    lines = [f"    {source} --> {row.target}: {row.when}" for row in TRANSITIONS for source in row.sources]
    return "\n".join(["stateDiagram-v2", *(f"    {mode}" for mode in Mode), *lines])


@pytest.mark.parametrize(("change", "message"), [
    ({"carrier_off_db_hz": 22.0}, "carrier_off_db_hz=22.0 must be < carrier_on_db_hz=22.0"),
    ({"monopulse_on_db_hz": 17.0, "monopulse_off_db_hz": 16.0}, "monopulse_off_db_hz=16.0 must be >= carrier_off"),
])  # fmt: skip
def test_gates_without_hysteresis_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        AutotrackParams(**change)


def test_unknown_request_is_refused() -> None:
    with pytest.raises(ValueError, match="request='fly' must be one of idle, track, calibrate"):
        AutotrackInputs(t_s=0.0, request="fly", target_available=True, on_target=True)


def test_page_about_autotrack_shows_the_table_as_it_is() -> None:
    page = (Path(__file__).parents[2] / "docs" / "math" / "autotrack.md").read_text()
    assert transition_table() in page
    assert transition_diagram() in page


def test_invalid_errors_on_the_way_to_where_the_search_heard_the_carrier_do_not_count() -> None:
    driver = Driver(sensor="monopulse")
    driver.run(1.0, 50.0, monopulse_valid=True)
    assert driver.state.mode == "monopulse"
    assert driver.run(3.0, 50.0, monopulse_valid=False, arriving=True) == "monopulse"
    assert driver.run(driver.table.params.patience_s, 50.0, monopulse_valid=False) == "monopulse"
    assert driver.run(0.3, 50.0, monopulse_valid=False) == "coast"


@pytest.mark.parametrize("sensor", ["conscan", "steptrack"])
def test_a_carrier_heard_from_outside_the_beam_is_searched_for_not_scanned(sensor: str) -> None:
    driver = Driver(sensor=sensor)
    assert driver.run(1.0, 30.0, axis_db_hz=50.0) == "program_track"
    assert driver.run(driver.table.params.settle_s, 30.0, axis_db_hz=50.0) == "search"
    # The search found 49 dB-Hz at most: the link is what it is, and 42 within the beam.
    driver.run(1.0, 49.0, axis_db_hz=60.0)
    driver.run(driver.table.params.search_turn_s + 0.5, 30.0, axis_db_hz=60.0)
    assert driver.state.mode == "coast"
    assert driver.run(0.2, 42.0, axis_db_hz=60.0) == sensor
    assert driver.run(driver.table.params.patience_s + 0.3, 35.0, axis_db_hz=60.0) == "search"


def test_after_a_sidelobe_monopulse_waits_for_a_search_that_learns_the_level() -> None:
    """A link that is stated 11 dB too strong costs one search and not the pass."""
    table, seen = Autotrack(AutotrackParams(sensor="monopulse")), frozenset({"monopulse"})
    state, modes = AutotrackState(mode="monopulse", carrier=True, strong=True), []
    for k in range(400):
        t_s = 0.1 * k
        # The beam of a search meets the target's middle at 12 s; elsewhere it is 8 dB down.
        searching = state.mode == "search"
        level = 49.0 if not searching or abs(t_s - 12.0) < 0.3 else 41.0
        inputs = AutotrackInputs(
            t_s=t_s, request="track", target_available=True, on_target=True, carrier_to_noise_db_hz=level,
            axis_db_hz=60.0, valid=seen, fault="sidelobe: planted" if k == 1 else "", sidelobe=k == 1,
        )  # fmt: skip
        state = table.step(state, inputs)
        modes += [state.mode] if not modes or modes[-1] != state.mode else []
    assert modes == ["monopulse", "hand_back", "program_track", "search", "coast", "monopulse"]
    assert state.learned_db == pytest.approx(-11.0)


@pytest.mark.parametrize(("begun_db", "lock_db"), [(-9.9, -8.0), (-10.1, math.inf)])
def test_a_lock_is_judged_by_the_level_that_proved_it(begun_db: float, lock_db: float) -> None:
    """Taken over 9.9 dB below the link's, it rose to -8 dB; one that began lower is judged by the link."""
    driver = Driver(sensor="monopulse").searching()
    for excess_db in (begun_db, begun_db, -8.0, -10.2):
        driver.run(TICK_S, 85.0 + excess_db, monopulse_valid=True, axis_db_hz=85.0)
    assert driver.state.mode == "monopulse"
    assert driver.state.lock_db == pytest.approx(lock_db)


def test_a_search_on_a_sidelobe_does_not_end_with_its_own_peak_as_the_level() -> None:
    """The strongest so far is 27 dB down and the error valid: after a sidelobe the search goes on."""
    driver = Driver(sensor="monopulse").searching(sidelobe=True)
    assert driver.run(2.0, 58.0, monopulse_valid=True, axis_db_hz=85.0) == "search"
    assert driver.run(TICK_S, 84.0, monopulse_valid=True, axis_db_hz=85.0) == "monopulse"


@pytest.mark.parametrize("t_s", [math.nan, math.inf])
def test_a_time_that_is_no_number_is_refused(t_s: float) -> None:
    with pytest.raises(ValueError, match="t_s"):
        AutotrackInputs(t_s=t_s, request="track", target_available=True, on_target=True)


def test_a_calibration_scan_takes_its_time_and_forgives_the_false_locks() -> None:
    driver = Driver(calibrate_s=25.0, most_false_locks=5).on_monopulse()
    driver.run(0.1, 50.0, monopulse_valid=True, fault="sign flip")
    assert driver.state.false_locks == 1
    driver.run(8.0, 50.0, monopulse_valid=True)
    assert driver.run(0.1, 50.0, monopulse_valid=True, request="calibrate") == "calibrate"
    assert driver.state.false_locks == 0
    assert driver.run(24.5, 50.0, monopulse_valid=True) == "calibrate"
    assert driver.run(1.0, 50.0, monopulse_valid=True) != "calibrate"
    assert driver.modes[-2:] == ["coast", "monopulse"]


def test_an_array_follows_its_own_levels_and_is_never_searched_for() -> None:
    """It sees most of the sky: a search would move the beam without showing it any more."""
    driver, seen = Driver(sensor="array"), {"valid": frozenset({"array"})}
    assert driver.table.params.own_level
    assert driver.run(10.0, 30.9, **seen) == "program_track"
    assert driver.run(0.2, 31.1, **seen) == "program_track"
    assert driver.run(0.3, 31.1, **seen) == "array"
    assert driver.state.integrating
    # However strong it is, that says nothing about the feed of the dish.
    assert driver.run(5.0, 60.0, **seen) == "array"
    assert not driver.state.strong
    assert driver.run(5.0, 28.1, **seen) == "array"
    assert driver.run(TICK_S, 27.9, **seen) == "coast"
    assert driver.run(60.0, 30.9, **seen) == "coast"
    assert driver.run(0.6, 31.1, **seen) == "array"
    assert driver.run(0.9, 40.0, valid=frozenset()) == "array"
    assert driver.run(0.4, 40.0, valid=frozenset()) == "coast"
    assert set(driver.modes) == {"idle", "slew", "program_track", "array", "coast"}


@pytest.mark.parametrize(("share", "mode"), [(0.97, "before"), (1.03, "after")])
@pytest.mark.parametrize(
    ("start", "name", "target"),
    [
        ("program_track", "settle_s", "search"), ("coast", "coast_s", "search"), ("search", "search_s", "program_track"),
        ("hand_back", "hold_s", "program_track"), ("calibrate", "calibrate_s", "coast"),
    ],
)  # fmt: skip
def test_each_mode_that_waits_does_so_for_its_own_time(
    start: str, name: str, target: str, share: float, mode: str
) -> None:
    times = {"settle_s": 7.0, "coast_s": 11.0, "search_s": 13.0, "hold_s": 17.0, "calibrate_s": 19.0}
    table = Autotrack(AutotrackParams(**times))
    begun_s = 1.7e9
    calibrating = start == "calibrate"
    state = AutotrackState(
        mode=start, entered_s=begun_s, carrier=calibrating, carrier_since_s=begun_s if calibrating else None
    )
    inputs = AutotrackInputs(
        t_s=begun_s + share * times[name], request="calibrate" if calibrating else "track", target_available=True,
        on_target=True, carrier_to_noise_db_hz=30.0 if calibrating else -math.inf, valid=frozenset(),
    )  # fmt: skip
    found = table.step(state, inputs)
    assert found.mode == (start if mode == "before" else target)
    assert found.entered_s == (begun_s if mode == "before" else inputs.t_s)


def inputs_at(t_s: float, level_db_hz: float, **changes: object) -> AutotrackInputs:
    """A target that is requested, available and reached, every sensor valid."""
    values = {
        "request": "track", "target_available": True, "on_target": True,
        "valid": frozenset({"monopulse", "conscan", "steptrack", "array"}), **changes,
    }  # fmt: skip
    return AutotrackInputs(t_s=t_s, carrier_to_noise_db_hz=level_db_hz, **values)


@pytest.mark.parametrize(
    ("mode", "t_s", "level_db_hz", "valid", "peak_db", "target", "learned_db"),
    [
        ("search", 20.0, 40.0, (), -3.0, "coast", -3.0), ("search", 20.0, 40.0, (), 2.5, "coast", 0.0),
        ("search", 20.0, 48.0, ("monopulse",), -3.0, "monopulse", -1.5), ("monopulse", 20.0, 5.0, (), -3.0, "coast", -1.5),
        ("search", 100.0, 15.0, (), -3.0, "coast", -3.0),
    ],
)  # fmt: skip
def test_only_a_search_that_ends_at_its_peak_teaches_the_level_and_never_more_than_the_links(
    mode: str, t_s: float, level_db_hz: float, valid: tuple[str, ...], peak_db: float, target: str, learned_db: float
) -> None:
    state = AutotrackState(
        mode=mode, carrier=True, strong=True, carrier_since_s=0.0, peak_s=10.0, peak_db_hz=52.0 + peak_db,
        peak_excess_db=peak_db, learned_db=-1.5,
    )  # fmt: skip
    seen = inputs_at(t_s, level_db_hz, axis_db_hz=52.0, valid=frozenset(valid))
    found = Autotrack(AutotrackParams(sensor="monopulse")).step(state, seen)
    assert (found.mode, found.learned_db) == (target, learned_db)
    assert (found.peak_s, found.peak_db_hz, found.entered_s) == (10.0, 52.0 + peak_db, t_s)
