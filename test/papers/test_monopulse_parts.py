"""What the monopulse rows are made of, on receivers, trackers, flights and feeds that are planted."""

import math
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.controllers import CommandPreprocessorParams, PositionLoopParams
from rf_pointing.core import MDEG, random_stream
from rf_pointing.papers import monopulse, monopulse_dropouts, monopulse_loop
from rf_pointing.papers.monopulse_dropouts import AutotrackRadio
from rf_pointing.papers.monopulse_loop import MonopulsePass, PassLog, PlainRadio
from rf_pointing.papers.servo_trajectory import LowOrbitPass, MotionTable
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD
from rf_pointing.servo import dss13_plant

Array = NDArray[np.float64]
BEAM_RAD = HALF_POWER_BEAMWIDTH_RAD["Ka"]
NOISE = random_stream(1, "unused")


def measured(right: float = 0.0, up: float = 0.0, valid: bool = True, t_s: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(
        cross_elevation_rad=right, elevation_rad=up, valid=valid, t_s=t_s, carrier_to_noise_db_hz=47.0,
        covariance_rad2=np.diag([4.0, 1.0]),
    )  # fmt: skip


class Receiver:
    """Stands in for a receiver: notes what it is asked for, and returns it."""

    def __init__(self) -> None:
        self.asked: list[tuple[Array, Array, Array, object, float]] = []
        self.feed: object = "right"
        self.feeds: list[object] = []

    def cluster(self, t_s: Array, x: Array, y: Array, level: object, sample_s: float) -> int:
        self.asked.append((t_s, x, y, level, sample_s))
        self.feeds.append(self.feed)
        return len(self.asked) - 1


def planted_radio(monkeypatch: pytest.MonkeyPatch, errors: Callable[[int], SimpleNamespace]) -> Receiver:
    """Put a receiver without noise, and a tracker with these errors, into the module `monopulse`."""
    receiver = Receiver()
    monkeypatch.setattr(monopulse, "Receiver", lambda *_: receiver)
    monkeypatch.setattr(monopulse, "MonopulseTracker", lambda _: SimpleNamespace(measure=errors))
    return receiver


# Averaging.


def test_an_averaged_cluster_is_held_against_its_last_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    clusters: list[SimpleNamespace] = []

    def measure(cluster: SimpleNamespace) -> SimpleNamespace:
        clusters.append(cluster)
        return measured(0.3 * cluster.difference_cross_elevation[4].real)

    tracker = SimpleNamespace(measure=measure, params=SimpleNamespace(slope=1.5))
    monkeypatch.setattr(monopulse, "MonopulseTracker", lambda _: tracker)
    gain = monopulse.averaging_gain_db(6.0, 40, random_stream(2, "averaged"))
    # All tracked errors are 0.3 of the last difference, which is 1.5 per beamwidth.
    assert gain == pytest.approx(20.0 * math.log10(BEAM_RAD / 1.5 / 0.3), rel=1e-9)
    noise = np.concatenate([cluster.difference_cross_elevation.real for cluster in clusters])
    assert len(noise) == 200
    assert np.std(noise) == pytest.approx(0.1)
    spectrum = np.abs(np.fft.rfft(noise))
    low = np.fft.rfftfreq(200, 0.02) < 6.0
    assert np.max(spectrum[low]) < 1e-9 < 0.01 < np.min(spectrum[~low])
    for cluster in clusters:
        np.testing.assert_allclose(cluster.t_s, [0.0, 0.02, 0.04, 0.06, 0.08])
        np.testing.assert_array_equal(cluster.sum, np.ones(5))
        assert not np.any(cluster.difference_elevation)
        assert cluster.carrier_to_noise_db_hz == 60.0


@pytest.mark.parametrize(("cutoff_hz", "lowest_hz"), [(0.0, 1e-3), (8.0, 8.0), (13.0, 13.0)])
def test_the_averaging_limit_is_a_mean_of_fejers_kernel_over_the_band_of_the_noise(
    cutoff_hz: float, lowest_hz: float
) -> None:
    x = math.pi * 0.02 * np.linspace(lowest_hz, 25.0, 20001)
    kernel = (5.0 + 2.0 * sum((5.0 - k) * np.cos(2.0 * k * x) for k in range(1, 5))) / 25.0
    assert monopulse.averaging_limit_db(cutoff_hz) == pytest.approx(-10.0 * math.log10(np.mean(kernel)), rel=1e-9)


def test_the_averaging_rows_have_streams_of_their_own_and_their_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[float] = []
    limits: list[float] = []

    def gain(cutoff_hz: float, clusters: int, random: np.random.Generator) -> float:
        assert clusters == 4000
        drawn.append(random.random())
        return 7.1 if cutoff_hz == 0.0 else coloured

    def limit(cutoff_hz: float) -> float:
        limits.append(cutoff_hz)
        return 15.7 if cutoff_hz == 8.0 else best if 9.0 < cutoff_hz < 9.15 else 12.0

    monkeypatch.setattr(monopulse, "averaging_gain_db", gain)
    monkeypatch.setattr(monopulse, "averaging_limit_db", limit)
    for coloured, best, explained in (
        (16.0, 16.9, True), (15.4, 16.9, True), (16.1, 16.9, False), (15.3, 16.9, False), (16.0, 17.1, False),
    ):  # fmt: skip
        white, line = monopulse._averaging_rows(3)
        assert (white.ours, white.paper, white.tolerance) == (7.1, 7.0, 0.35)
        assert (line.ours, line.paper, line.tolerance, line.explained) == (coloured, 17.0, 1.0, explained)
        assert f"at most {best:.2f} dB" in line.remark
        assert "exactly 15.70 dB" in line.remark
    assert drawn[:2] == [random_stream(3, f"averaging {f}").random() for f in (0.0, 8.0)]
    assert limits[:100] == pytest.approx([5.0 + 0.1 * k for k in range(100)])
    assert limits[100] in (0.0, 8.0)


# Honesty of the covariance.


def test_normalised_errors_are_of_valid_clusters_after_20_s(monkeypatch: pytest.MonkeyPatch) -> None:
    def error(k: int) -> SimpleNamespace:
        # Twice the standard deviation off to the right, once up; every third cluster is not valid.
        return measured(10.0 + 4.0, -3.0 + 1.0 + 0.01 * k, valid=k % 3 > 0)

    receiver = planted_radio(monkeypatch, error)
    found = monopulse.monopulse_normalised_errors(45.0, np.array([10.0, -3.0]), 8, NOISE)
    kept = [k for k in range(200, 208) if k % 3]
    assert found == pytest.approx([0.5 * (4.0 + (1.0 + 0.01 * k) ** 2) for k in kept])
    assert len(receiver.asked) == 208
    for k, (t_s, x, y, level, sample_s) in enumerate(receiver.asked):
        np.testing.assert_allclose(t_s, 0.1 * k + 0.02 * np.arange(5), atol=1e-9)
        assert (x.tolist(), y.tolist(), level, sample_s) == ([10.0] * 5, [-3.0] * 5, 45.0, 0.02)


def test_the_honesty_row_has_the_interval_of_its_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[float, list[float], int, float]] = []

    def normalised(level: float, error: Array, runs: int, random: np.random.Generator) -> Array:
        asked.append((level, (error / MDEG).tolist(), runs, random.random()))
        return np.array([0.8, 1.4])

    monkeypatch.setattr(monopulse, "monopulse_normalised_errors", normalised)
    row = monopulse._honesty_row(5)
    assert asked == [(45.0, [2.0, -1.0], 1000, random_stream(5, "monopulse honesty").random())]
    assert (row.ours, row.paper, row.tolerance) == (pytest.approx(1.1), 1.0, pytest.approx(1.96 / math.sqrt(1000.0)))
    assert row.remark.startswith("2 of 1000 errors valid")


# False locks.


def test_a_false_lock_is_where_the_differences_rise_through_zero_and_not_where_they_jump(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A line that rises by 0.02 a point, once made to jump through zero in one, and once to fall through it."""
    places: list[Array] = []

    def voltages(x: Array, y: Array) -> SimpleNamespace:
        places.append(x)
        np.testing.assert_array_equal(x, y)
        ratio = np.full(len(x), 0.05)
        # Falls, rises too steeply, falls again, and rises through zero between points 1200 and 1201.
        ratio[100:200] = -0.06
        ratio[200:300] = 0.06
        ratio[300:] = np.minimum(0.02 * (np.arange(300, len(x)) - 1200.5), 3.0)
        total = np.full(len(x), 2.0 + 0j)
        return SimpleNamespace(difference_cross_elevation=ratio * total, sum=total)

    monkeypatch.setattr(monopulse, "MonopulseFeed", lambda *_: SimpleNamespace(voltages=voltages))
    found = monopulse.false_lock_rad()
    (x,) = places
    assert (len(x), x[0] / BEAM_RAD, x[-1] / BEAM_RAD) == (3001, pytest.approx(0.9), pytest.approx(1.3))
    assert found == x[1200]


def test_a_loop_on_a_false_lock_follows_its_errors_until_the_watch_speaks(monkeypatch: pytest.MonkeyPatch) -> None:
    watched: list[tuple[object, ...]] = []
    errors = [measured(1e-5 * k, -2e-5, valid=k != 2) for k in range(200)]
    receiver = planted_radio(monkeypatch, errors.__getitem__)

    def add(error: object, *rest: float) -> str:
        watched.append((error, *rest))
        return "level" if len(watched) == speaks else ""

    monkeypatch.setattr(monopulse, "LockWatch", lambda _: SimpleNamespace(add=add))
    monkeypatch.setattr(monopulse, "false_lock_rad", lambda: 3e-3)
    speaks = 6
    assert monopulse.sidelobe_lock_s(NOISE) == ("level", pytest.approx(0.6))
    step = 2.0 * math.pi * 0.1 * 0.1
    beam = np.zeros(2)
    for k in range(6):
        t_s, x, y, level, sample_s = receiver.asked[k]
        np.testing.assert_allclose(t_s, 0.1 * k + 0.02 * np.arange(1, 6), atol=1e-9)
        np.testing.assert_allclose(x, np.full(5, 3e-3 + 0.5 * MDEG - beam[0]), rtol=1e-12)
        np.testing.assert_allclose(y, np.full(5, 3e-3 - beam[1]), rtol=1e-12)
        assert (level, sample_s) == (60.0, 0.02)
        assert watched[k] == (errors[k], pytest.approx(beam[0]), pytest.approx(beam[1]), 60.0)
        beam += step * np.array([1e-5 * k, -2e-5]) * (k != 2)
    watched.clear()
    receiver.asked.clear()
    speaks = -1
    assert monopulse.sidelobe_lock_s(NOISE) == ("nothing found", math.inf)
    # Ten seconds.
    assert len(watched) == 100


# The rows of flights.


class Flights:
    """Stands in for `fly` and the radios: notes setups and radios, and returns a log of the given errors."""

    def __init__(self, *sizes: float) -> None:
        self.flown: list[tuple[MonopulsePass, SimpleNamespace]] = []
        self._sizes = sizes

    def fly(self, setup: MonopulsePass, radio: SimpleNamespace) -> PassLog:
        size = MDEG * self._sizes[len(self.flown)]
        self.flown.append((setup, radio))
        t_s = setup.start_s + 0.02 * np.arange(3000)
        error = size * np.column_stack([np.full(3000, 3.0), np.full(3000, 4.0)])
        error[t_s < setup.start_s + setup.settle_s - 1e-6] *= 10.0
        velocity = np.zeros((3000, 2))
        velocity[50:, 0], velocity[70:, 1] = 1e-4, -3e-4
        return PassLog(t_s, error, velocity, np.arange(3000) % 4 > 0)

    def radio(
        self, setup: MonopulsePass, bandwidth: float, level: float, *rest: object, **more: object
    ) -> SimpleNamespace:
        return SimpleNamespace(
            setup=setup, bandwidth=bandwidth, level=level, rest=rest, more=more, fault="", fault_s=41.5, modes="modes"
        )


@pytest.fixture
def flights(monkeypatch: pytest.MonkeyPatch) -> Flights:
    found = Flights(2.0, 0.5, 0.1)
    monkeypatch.setattr(monopulse, "fly", found.fly)
    monkeypatch.setattr(monopulse, "PlainRadio", found.radio)
    monkeypatch.setattr(monopulse, "AutotrackRadio", found.radio)
    return found


def test_bandwidths_are_compared_on_one_ideal_antenna(flights: Flights) -> None:
    plain, notched = monopulse._bandwidth_rows(4)
    assert (plain.ours, plain.paper, plain.tolerance, plain.bound) == (pytest.approx(4.0), 2.0, 0.0, ">=")
    assert (notched.ours, notched.paper, notched.tolerance, notched.bound) == (pytest.approx(20.0), 10.0, 0.0, ">=")
    assert plain.remark.startswith("program track 8.00 mdeg rms, monopulse 2.000;")
    assert notched.remark.startswith("program track 8.00 mdeg rms, monopulse 0.400,")
    ideal = dss13_plant(ideal=True)
    without = MonopulsePass(plant=ideal, loop=PositionLoopParams(notch_enabled=False), seed=4)
    with_notch = MonopulsePass(plant=ideal, seed=4)
    assert [(setup, radio.setup, radio.bandwidth, radio.level) for setup, radio in flights.flown] == [
        (without, without, 0.0, 45.0), (without, without, 0.04, 45.0), (with_notch, with_notch, 0.3, 45.0),
    ]  # fmt: skip


def test_the_wind_row_is_the_radial_error_of_the_stiffer_loop(flights: Flights) -> None:
    row = monopulse._wind_row(4)
    assert (row.ours, row.paper, row.tolerance, row.bound) == (pytest.approx(10.0), 2.0, 0.0, "<=")
    assert "cross-elevation 6.00, elevation 8.00 mdeg" in row.remark
    ((setup, radio),) = flights.flown
    assert setup == MonopulsePass(loop=PositionLoopParams(proportional_gain=1.0), wind_m_s=8.0, seed=4)
    assert (radio.bandwidth, radio.level) == (0.2, 45.0)


def test_false_locks_are_timed_from_the_flip_and_from_the_start(
    flights: Flights, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(monopulse, "sidelobe_lock_s", lambda random: ("sidelobe", random.random()))
    flip, sidelobe = monopulse._false_lock_rows(4)
    assert flip.ours == pytest.approx(1.5)
    assert (sidelobe.ours, sidelobe.remark) == (random_stream(4, "sidelobe").random(), "sidelobe")
    for row in (flip, sidelobe):
        assert (row.paper, row.tolerance, row.bound) == (2.0, 0.0, "<=")
    ((setup, radio),) = flights.flown
    assert setup == MonopulsePass(wind_m_s=8.0, seed=4)
    assert (radio.bandwidth, radio.level, radio.more) == (0.3, 45.0, {"flip_s": 40.0})


def test_dropout_rows_count_the_finite_times_and_take_the_steepest_command(
    flights: Flights, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(monopulse, "draw_dropouts", lambda setup, count: (setup, count))

    def times(modes: object, dropouts: tuple[MonopulsePass, int]) -> Array:
        assert (modes, dropouts[1]) == ("modes", 10)
        return np.array([0.0, 1.5, math.inf])

    monkeypatch.setattr(monopulse, "reacquisition_times_s", times)
    found, steepest = monopulse._dropout_rows(4)
    assert (found.ours, found.paper, found.tolerance) == (2.0, 10.0, 0.0)
    # 3e-4 rad/s in one tick.
    assert steepest.ours == pytest.approx(math.degrees(0.015))
    limit = math.degrees(min(CommandPreprocessorParams().acceleration_limit_rad_s2))
    assert (steepest.paper, steepest.tolerance, steepest.bound) == (pytest.approx(limit), 1e-6, "<=")
    assert "75.0 % of the commands" in steepest.remark
    ((setup, radio),) = flights.flown
    assert setup == MonopulsePass(start_s=-180.0, end_s=150.0, late_s=0.05, wind_m_s=8.0, seed=4)
    assert (radio.bandwidth, radio.level, radio.rest) == (0.3, 45.0, ((setup, 10),))


def test_all_rows_of_monopulse_take_one_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_averaging_rows", "_bandwidth_rows", "_false_lock_rows", "_dropout_rows"):
        monkeypatch.setattr(monopulse, name, lambda seed, name=name: [(name, seed)])
    for name in ("_honesty_row", "_wind_row"):
        monkeypatch.setattr(monopulse, name, lambda seed, name=name: (name, seed))
    names = ["_averaging_rows", "_honesty_row", "_bandwidth_rows", "_wind_row", "_false_lock_rows", "_dropout_rows"]
    assert monopulse.rows(3) == [(name, 3) for name in names]
    assert monopulse.rows() == [(name, 1) for name in names]


# The loop.


def test_the_ephemeris_has_a_row_at_every_tick() -> None:
    found = MonopulsePass(start_s=-3.0, end_s=1.0).ephemeris()
    np.testing.assert_allclose(found.t_s, -3.0 + 0.02 * np.arange(201), atol=1e-9)
    np.testing.assert_array_equal(found.position_rad, LowOrbitPass().at(found.t_s).position_rad)


def test_rms_errors_count_from_the_settling_time_on() -> None:
    error = np.array([[9.0, 9.0], [9.0, 9.0], [1.0, 2.0], [3.0, 6.0]])
    log = PassLog(np.array([5.0, 6.0, 7.0, 8.0]), error, error, np.ones(4, dtype=bool))
    axes, radial = log.rms_rad(2.0)
    assert axes == pytest.approx([math.sqrt(5.0), math.sqrt(20.0)])
    assert radial == pytest.approx(5.0)


def test_a_command_is_the_ephemeris_with_the_offset_of_the_sky_turned_into_the_axes() -> None:
    """Its rate is the derivative of its position: the cosine of the elevation changes too."""
    orbit, step = LowOrbitPass(), 1e-3
    table = orbit.at(np.array([30.0 - step, 30.0, 30.0 + step]))
    offset, rate = np.array([4e-3, -2e-3]), np.array([1e-3, 5e-3])
    places = [monopulse_loop._command(table, k, offset + (k - 1) * step * rate, rate) for k in range(3)]
    position, velocity, acceleration = places[1]
    elevation = table.position_rad[1, 1]
    np.testing.assert_allclose(position, table.position_rad[1] + [4e-3 / math.cos(elevation), -2e-3], rtol=1e-12)
    np.testing.assert_allclose(velocity, (places[2][0] - places[0][0]) / (2.0 * step), rtol=1e-7)
    np.testing.assert_array_equal(acceleration, table.acceleration_rad_s2[1])


class Integrator:
    """Stands in for the integrator: notes what acts, and when."""

    def __init__(self, params: object = None) -> None:
        self.params = params
        self.updates: list[tuple[float, list[float]]] = []
        self.resets: list[tuple[float, list[float]]] = []

    def update(self, t_s: float, error_rad: Array) -> None:
        self.updates.append((t_s, error_rad.tolist()))

    def reset(self, t_s: float, offset_rad: Array) -> None:
        self.resets.append((t_s, offset_rad.tolist()))

    def at(self, t_s: float) -> tuple[Array, Array]:
        return np.array([t_s, 7.0]), np.array([8.0, 9.0])


def plain_radio(
    monkeypatch: pytest.MonkeyPatch, faults: list[str]
) -> tuple[PlainRadio, Receiver, list[tuple[object, ...]]]:
    monkeypatch.setattr(monopulse_loop, "TrackerIntegrator", Integrator)
    radio = PlainRadio(MonopulsePass(seed=4), 0.3, 50.0, flip_s=0.35)
    receiver, watched = Receiver(), []
    flipped = radio._flipped
    assert (flipped.params.difference_phase_rad) == (math.pi, math.pi)
    radio._receiver, radio._flipped = receiver, "flipped"
    radio._tracker = SimpleNamespace(measure=lambda k: measured(0.1 * k, -0.2 * k, valid=k != 1))

    def add(error: object, *beam: float) -> str:
        watched.append((error, *beam))
        return faults[len(watched) - 1]

    radio._watch = SimpleNamespace(add=add)
    return radio, receiver, watched


def test_a_plain_radio_lets_a_cluster_act_one_cluster_later(monkeypatch: pytest.MonkeyPatch) -> None:
    radio, receiver, watched = plain_radio(monkeypatch, [""] * 3 + ["turned"] + [""])
    for k in range(1, 20):
        radio.sample(k, np.array([1.0 * k, -1.0 * k]), np.array([0.5 * k, 3.0]))
    assert [part.tolist() for part in radio.offset(20)] == [[0.4, 7.0], [8.0, 9.0]]
    assert not radio.stop
    assert (radio.fault, radio.fault_s) == ("", math.inf)
    radio.sample(20, np.array([20.0, -20.0]), np.array([10.0, 3.0]))
    integrator = radio._integrator
    assert (integrator.params.bandwidth_hz, integrator.params.sample_s) == (0.3, 0.1)
    # Clusters end at ticks 5, 10, 15 and 20; the second one is not valid.
    assert [t_s for t_s, _ in integrator.updates] == pytest.approx([0.2, 0.4])
    assert [error for _, error in integrator.updates] == [[0.0, -0.0], [0.2, -0.4]]
    for number, (t_s, x, y, level, tick_s) in enumerate(receiver.asked):
        ticks = 5 * number + np.arange(1, 6)
        np.testing.assert_allclose(t_s, 0.02 * ticks)
        np.testing.assert_allclose([x, y], [ticks, -ticks])
        assert (level, tick_s) == (50.0, 0.02)
        assert watched[number][1:] == pytest.approx((0.5 * (5 * number + 3), 3.0))
    # From 0.35 s on, which the cluster at 0.4 s is the first behind.
    assert receiver.feeds == ["right", "right", "right", "flipped"]
    assert (radio.stop, radio.fault, radio.fault_s) == (True, "turned", pytest.approx(0.4))


def test_a_radio_hears_45_db_hz_and_no_flip_where_nothing_else_is_said() -> None:
    radio = PlainRadio(MonopulsePass(), 0.3)
    assert (radio._level_db_hz, radio._flip_s) == (45.0, math.inf)
    feed = radio._receiver.feed
    assert feed.params.difference_phase_rad == (0.0, 0.0)


class Listener:
    """A radio that moves nothing and notes what it is given."""

    def __init__(self, last: int = 10**6) -> None:
        self.stop, self._last = False, last
        self.samples: list[tuple[int, Array, Array]] = []

    def offset(self, _k: int) -> tuple[Array, Array]:
        return np.zeros(2), np.zeros(2)

    def sample(self, k: int, miss_rad: Array, beam_rad: Array) -> None:
        self.samples.append((k, miss_rad, beam_rad))
        self.stop = k == self._last


def test_a_pass_gives_its_radio_the_errors_of_the_sky_at_the_end_of_every_tick() -> None:
    """A law without gains leaves the antenna where it stands: what is measured is the motion itself."""
    still = PositionLoopParams(proportional_gain=0.0, integral_gain=0.0, feedforward_gain=0.0, notch_enabled=False)
    setup = MonopulsePass(plant=dss13_plant(ideal=True), loop=still, start_s=-20.0, end_s=-19.0, late_s=0.03)
    radio, first = Listener(), setup.ephemeris().position_rad[0]
    # At rest instead of in motion with the target.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(monopulse_loop.LawsOnCommand, "settle", lambda *_: None)
        log = monopulse_loop.fly(setup, radio)
    t_s = -20.0 + 0.02 * np.arange(1, 51)
    np.testing.assert_allclose(log.t_s, t_s, atol=1e-9)
    truth, ephemeris = LowOrbitPass().at(t_s - 0.03).position_rad, LowOrbitPass().at(t_s)
    sky = np.column_stack([np.cos(truth[:, 1]), np.ones(50)])
    np.testing.assert_allclose(log.error_rad, (truth - first) * sky, atol=1e-9)
    assert [k for k, _, _ in radio.samples] == list(range(1, 51))
    np.testing.assert_array_equal([miss for _, miss, _ in radio.samples], log.error_rad)
    shown = [beam for _, _, beam in radio.samples]
    np.testing.assert_allclose(shown, (first - ephemeris.position_rad) * sky, atol=1e-9)
    # The preprocessor begins in motion and after half a second passes a smooth pass unchanged.
    before = LowOrbitPass().at(t_s - 0.02).velocity_rad_s
    np.testing.assert_allclose(log.command_velocity_rad_s[:2], before[:2], atol=1e-3)
    assert np.all(log.transparent[30:])
    np.testing.assert_allclose(log.command_velocity_rad_s[30:], before[30:], rtol=1e-6)


def test_a_settled_pass_begins_without_an_error() -> None:
    setup = MonopulsePass(plant=dss13_plant(ideal=True), start_s=-20.0, end_s=-19.0, late_s=0.0)
    log = monopulse_loop.fly(setup, Listener())
    assert np.max(np.abs(log.error_rad)) < 1.5e-4


def test_preprocessor_and_laws_begin_in_motion_on_the_first_point(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[list[float]] = []
    monkeypatch.setattr(
        monopulse_loop.CommandPreprocessor, "reset", lambda _self, *point: begun.append(np.concatenate(point).tolist())
    )
    monkeypatch.setattr(
        monopulse_loop.LawsOnCommand,
        "settle",
        lambda _self, _plant, *point: begun.append(np.concatenate(point).tolist()),
    )
    monkeypatch.setattr(monopulse_loop, "ticks", lambda *_: [])
    setup = MonopulsePass(start_s=-20.0, end_s=-19.0)
    monopulse_loop.fly(setup, Listener())
    first = LowOrbitPass().at([-20.0])
    assert begun == [[*first.position_rad[0], *first.velocity_rad_s[0]]] * 2


def test_a_radio_may_end_a_pass() -> None:
    setup = MonopulsePass(plant=dss13_plant(ideal=True), start_s=-20.0, end_s=-19.0)
    whole, short = (monopulse_loop.fly(setup, Listener(last)) for last in (10**6, 7))
    assert len(short.t_s) == 7
    for name in ("t_s", "error_rad", "command_velocity_rad_s", "transparent"):
        np.testing.assert_array_equal(getattr(short, name), getattr(whole, name)[:7])


# Dropouts.


class Trimmed:
    """Stands in for the trim filter: a trim that follows the time."""

    def __init__(self) -> None:
        self.updates: list[tuple[float, list[float], object]] = []

    def update(self, t_s: float, seen: Array, _covariance: Array, sky: object) -> None:
        self.updates.append((t_s, seen.tolist(), sky))

    def trim(self, t_s: float, _sky: object) -> SimpleNamespace:
        return SimpleNamespace(offset_rad=np.array([1e-3 * t_s, -2e-3]), covariance_rad2=np.diag([1e-8, 4e-8]))


@pytest.fixture
def autotrack(monkeypatch: pytest.MonkeyPatch) -> AutotrackRadio:
    monkeypatch.setattr(monopulse_dropouts, "TrackerIntegrator", Integrator)
    setup = MonopulsePass(start_s=-10.0, end_s=10.0)
    levels = SimpleNamespace(level_db_hz=lambda _times, level: level - 3.0)
    radio = AutotrackRadio(setup, 0.3, 50.0, levels)
    radio._receiver, radio._filter = Receiver(), Trimmed()
    radio._tracker = SimpleNamespace(measure=lambda k: measured(0.1 * k, -0.2, valid=k != 3, t_s=5.0 + k))
    return radio


def state(mode: str, integrating: bool) -> SimpleNamespace:
    return SimpleNamespace(mode=mode, integrating=integrating)


def test_a_new_radio_of_dropouts_holds_nothing(autotrack: AutotrackRadio) -> None:
    params = autotrack._integrator.params
    assert (params.bandwidth_hz, params.sample_s) == (0.3, pytest.approx(0.1))
    assert autotrack.state.mode == "program_track"
    assert not autotrack.stop
    # Trim alone, and its rate from one tick to the next.
    offset, rate = autotrack.offset(100)
    assert offset == pytest.approx([1e-3 * -8.0, -2e-3])
    assert rate == pytest.approx([1e-3, 0.0], abs=1e-9)


def test_what_was_held_fades_to_the_trim_in_3_s_and_a_spiral_comes_on_top(autotrack: AutotrackRadio) -> None:
    autotrack._held, autotrack._held_s = np.array([4e-3, 2e-3]), 1.0
    trim = np.array([1e-3 * -8.0, -2e-3])
    faded = math.exp(-1.0 / 3.0)
    assert autotrack._free(100) == pytest.approx(trim + np.array([4e-3, 2e-3]) * faded)
    # Before it is held nothing fades.
    autotrack._held_s = 2.5
    assert autotrack._free(100) == pytest.approx(trim + np.array([4e-3, 2e-3]))
    autotrack._held_s, autotrack._spiral_s = 1.0, 0.5
    asked: list[float] = []
    autotrack._spiral = SimpleNamespace(offset=lambda t_s: asked.append(t_s) or (5e-3, -6e-3, 7.0, 8.0))
    expected = trim + np.array([4e-3, 2e-3]) * faded + [5e-3, -6e-3]
    assert autotrack._free(100) == pytest.approx(expected)
    assert asked == [pytest.approx(1.5)]
    # The integrator alone while it tracks.
    autotrack.state = state("monopulse", True)
    assert [part.tolist() for part in autotrack.offset(100)] == [[2.0, 7.0], [8.0, 9.0]]


def test_the_sky_motion_is_that_of_the_ephemeris_with_the_range_of_a_round_earth(autotrack: AutotrackRadio) -> None:
    table: MotionTable = autotrack._ephemeris
    sky = autotrack._sky(70)
    elevation = table.position_rad[70, 1]
    assert sky.cross_elevation_rate_rad_s == pytest.approx(table.velocity_rad_s[70, 0] * math.cos(elevation))
    assert sky.elevation_rate_rad_s == pytest.approx(table.velocity_rad_s[70, 1])
    # The law of cosines at the station.
    earth, orbit = 6.371e6, 6.371e6 + 1000e3
    r = sky.range_m
    assert r**2 + earth**2 + 2.0 * r * earth * math.sin(elevation) == pytest.approx(orbit**2, rel=1e-12)


def test_a_search_is_sized_by_the_trims_uncertainty_and_slow(
    autotrack: AutotrackRadio, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(monopulse_dropouts, "SpiralSearch", lambda params: params)
    params = autotrack._search(3)
    assert params.half_power_beamwidth_rad == BEAM_RAD
    assert params.uncertainty_rad == pytest.approx(2e-4)
    assert params.rate_rad_s == pytest.approx(20.0 * MDEG)
    assert params.acceleration_rad_s2 == pytest.approx(20.0 * MDEG)


def test_the_table_decides_per_cluster_and_only_tracked_errors_act_and_teach(autotrack: AutotrackRadio) -> None:
    states = [state("monopulse", True)] * 5 + [state("coast", False)] * 2
    inputs: list[SimpleNamespace] = []

    def step(before: object, given: SimpleNamespace) -> SimpleNamespace:
        inputs.append(given)
        return states[len(inputs) - 1]

    autotrack._table = SimpleNamespace(step=step)
    for k in range(1, 36):
        autotrack.sample(k, np.array([1.0 * k, 2.0]), np.array([0.5 * k, 3.0]))
    receiver, integrator, trim = autotrack._receiver, autotrack._integrator, autotrack._filter
    assert len(receiver.asked) == len(inputs) == 7
    for number, (t_s, x, y, level, tick_s) in enumerate(receiver.asked):
        ticks = 5 * number + np.arange(1, 6)
        np.testing.assert_allclose(t_s, -10.0 + 0.02 * ticks)
        np.testing.assert_allclose([x, y], [ticks, np.full(5, 2.0)])
        assert (level.tolist(), tick_s) == ([47.0] * 5, 0.02)
        given = inputs[number]
        assert given.t_s == pytest.approx(-10.0 + 0.02 * (5 * number + 5))
        assert (given.request, given.target_available, given.on_target) == ("track", True, True)
        assert given.carrier_to_noise_db_hz == 47.0
        assert {sensor.name for sensor in given.valid} == ({"CONSCAN"} if number == 3 else {"CONSCAN", "MONOPULSE"})
    # Cluster 3 is not valid; what cluster 4 would do comes when the antenna coasts.
    assert [t_s for t_s, _ in integrator.updates] == pytest.approx([0.2, 0.3, 0.4])
    assert [error for _, error in integrator.updates] == [[0.0, -0.2], [0.1, -0.2], [0.2, -0.2]]
    taught = [0, 1, 2, 4]
    assert [t_s for t_s, _, _ in trim.updates] == [5.0 + k for k in taught]
    # Where the beam was over the cluster, and the error.
    expected = [[0.5 * (5 * k + 3) + 0.1 * k, 3.0 - 0.2] for k in taught]
    np.testing.assert_allclose([seen for _, seen, _ in trim.updates], expected)
    assert [sky for _, _, sky in trim.updates] == [autotrack._sky(5 * k + 5) for k in taught]
    assert [mode for _, mode in autotrack.modes] == ["monopulse", "coast"]
    assert [t_s for t_s, _ in autotrack.modes] == pytest.approx([-9.9, -9.4])
    assert autotrack._pending is None


def test_a_change_of_mode_continues_from_the_offset_in_force(
    autotrack: AutotrackRadio, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(monopulse_dropouts, "SpiralSearch", lambda _: SimpleNamespace(offset=lambda _: np.zeros(4)))
    changes = [state("monopulse", True), state("monopulse", True), state("coast", False), state("search", False),
               state("search", True)]  # fmt: skip
    autotrack._table = SimpleNamespace(step=lambda *_: changes.pop(0))
    free = autotrack._free(50).tolist()
    autotrack._decide(50, measured())
    autotrack._decide(55, measured())
    assert autotrack._integrator.resets == [(1.0, free)]
    assert autotrack._spiral is None
    autotrack._decide(100, measured())
    # The integrator was at (2, 7) then: what it has beyond the trim is held.
    assert autotrack._held == pytest.approx(np.array([2.0, 7.0]) - [1e-3 * -8.0, -2e-3])
    assert autotrack._held_s == pytest.approx(2.0)
    assert autotrack._spiral is None
    autotrack._decide(150, measured())
    assert autotrack._spiral is not None
    assert autotrack._spiral_s == autotrack._held_s == pytest.approx(3.0)
    last = autotrack._free(160).tolist()
    autotrack._decide(160, measured())
    assert autotrack._integrator.resets[1] == (pytest.approx(3.2), last)
    assert autotrack._spiral is None
    assert [mode for _, mode in autotrack.modes] == ["monopulse", "coast", "search", "search"]


def test_drawn_dropouts_leave_8_s_between_them_and_40_s_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(monopulse_dropouts, "Dropouts", lambda *args: args)
    params, start_s, end_s, random = monopulse_dropouts.draw_dropouts(MonopulsePass(start_s=-30.0, seed=3), 4)
    assert (params.count, params.gap_s, start_s, end_s) == (4, 8.0, 10.0, 40.0)
    assert random.random() == random_stream(3, "dropouts").random()
