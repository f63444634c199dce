import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams, element_weights
from rf_pointing.array_sensors.tripulse.beams import beam_signals
from rf_pointing.array_sensors.tripulse.channels import channel_values
from rf_pointing.array_sensors.tripulse.signal import TripulseFrame, TripulseSignalParams, segment_beams
from rf_pointing.array_sensors.tripulse.source import StationLine, TripulseSource, TripulseSourceParams

ARRAY, SIGNAL = TripulseArrayParams(), TripulseSignalParams()
TRUE = Rotation.from_rotvec([1e-3, -5e-4, 2e-3]).as_matrix()


def line(x: float = 0.05, y: float = -0.03, *, elevation_rad: float = 0.7, behind: bool = False) -> StationLine:
    z = np.sqrt(1.0 - x * x - y * y) * (-1.0 if behind else 1.0)
    return StationLine(name="usingen", direction=np.array([x, y, z]), range_rate_m_s=12.0, elevation_rad=elevation_rad)


def source(**changes: float) -> TripulseSource:
    return TripulseSource(ARRAY, SIGNAL, TripulseSourceParams(**changes), seed=3)


def test_noise_free_frame_holds_the_conjugate_beams_of_the_true_direction() -> None:
    quiet = source(
        element_carrier_to_noise_db_hz=120.0, reference_carrier_to_noise_db_hz=-20.0,
        satellite_linewidth_hz=0.0, station_linewidth_hz=0.0,
    )  # fmt: skip
    station = StationLine(name="a", direction=line().direction, range_rate_m_s=0.0, elevation_rad=0.7)
    (frame,) = quiet.step(0.0, TRUE, [station])
    weights = element_weights(ARRAY, frame.steering)
    beams = beam_signals(ARRAY, weights, (TRUE @ station.direction)[:2]).conj()
    means = frame.samples.reshape(SIGNAL.segments, -1).mean(axis=1)
    found = np.array([means[segment_beams(SIGNAL) == beam].mean() for beam in range(3)])
    np.testing.assert_allclose(found[1:] / found[0], beams[1:] / beams[0], atol=1e-5)


def test_beams_are_steered_by_the_prior_attitude() -> None:
    steered = source()
    np.testing.assert_allclose(steered.step(0.0, TRUE, [line()])[0].steering, [0.05, -0.03])
    steered.steer(TRUE)
    np.testing.assert_allclose(steered.step(1.0, TRUE, [line()])[0].steering, (TRUE @ line().direction)[:2])


def test_noise_has_density_one() -> None:
    weak = source(element_carrier_to_noise_db_hz=-20.0, reference_carrier_to_noise_db_hz=-20.0)
    power = np.mean([np.mean(np.abs(weak.step(float(k), TRUE, [line()])[0].samples) ** 2) for k in range(100)])
    # The array's own 655 Hz beside 4 MHz of noise, 96000 samples.
    assert power == pytest.approx(SIGNAL.sample_rate_hz, rel=0.015)


def test_resumed_source_sends_the_identical_frames() -> None:
    first = source()
    first.step(0.0, TRUE, [line()])
    state = first.state
    expected = first.step(1.0, TRUE, [line(), line(0.02, 0.01)])
    other = source()
    other.restore(state)
    for a, b in zip(expected, other.step(1.0, TRUE, [line(), line(0.02, 0.01)]), strict=True):
        np.testing.assert_array_equal(a.samples, b.samples)
        assert a.sequence == b.sequence == 2
    (another,) = TripulseSource(ARRAY, SIGNAL, TripulseSourceParams(), seed=4).step(1.0, TRUE, [line()])
    assert np.max(np.abs(another.samples - expected[0].samples)) > 1.0


def test_time_must_advance_and_rotations_must_be_rotations() -> None:
    running = source()
    running.step(1.0, TRUE, [line()])
    with pytest.raises(ValueError, match="t_s"):
        running.step(1.0, TRUE, [line()])
    with pytest.raises(ValueError, match="rotation misses orthonormality"):
        running.step(2.0, 1.1 * np.eye(3), [line()])
    with pytest.raises(ValueError, match="prior"):
        running.steer(np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(ValueError, match="finite"):
        running.step(2.0, np.full((3, 3), np.nan), [line()])


def segment_tones(frame: TripulseFrame, shift_hz: float) -> np.ndarray:
    return channel_values(SIGNAL, frame.samples, shift_hz, (-1, 0, 1))


def test_tones_have_the_levels_of_the_link_and_the_doppler_of_the_range_rate() -> None:
    """A^2 is C/N0 in hertz; f rho' / c at 12 GHz and 12 m/s are 480 Hz, toward lower frequencies."""
    still = source(
        element_carrier_to_noise_db_hz=100.0, reference_carrier_to_noise_db_hz=120.0, satellite_linewidth_hz=0.0,
        station_linewidth_hz=0.0,
    )  # fmt: skip
    (frame,) = still.step(0.0, TRUE, [line()])
    carrier_hz = SIGNAL.carrier_hz
    shift_hz = -carrier_hz * 12.0 / 299792458.0
    tones = segment_tones(frame, shift_hz)
    weights = element_weights(ARRAY, frame.steering)
    beams = beam_signals(ARRAY, weights, (TRUE @ line().direction)[:2])
    np.testing.assert_allclose(np.abs(tones[:, 0]), 1e6, rtol=2e-3)
    np.testing.assert_allclose(np.abs(tones[:, 2]), 1e6, rtol=2e-3)
    np.testing.assert_allclose(np.abs(tones[:, 1]), 1e5 * np.abs(beams)[segment_beams(SIGNAL)], rtol=5e-3, atol=1e4)
    # Nothing of the phase is left that turns with time.
    turned = np.unwrap(np.angle(tones[:, 0] * tones[:, 2]))
    assert np.ptp(turned) < 0.05


@pytest.mark.parametrize(("satellite_hz", "station_hz"), [(10.0, 0.0), (0.0, 40.0), (15.0, 25.0)])
def test_phases_wander_as_the_linewidths_of_both_clocks_say(satellite_hz: float, station_hz: float) -> None:
    """2 pi times the linewidth a second; means over neighbouring segments differ by two thirds of a segment's."""
    running = source(
        element_carrier_to_noise_db_hz=60.0, reference_carrier_to_noise_db_hz=150.0, satellite_linewidth_hz=satellite_hz,
        station_linewidth_hz=station_hz,
    )  # fmt: skip
    station = StationLine(name="a", direction=line().direction, range_rate_m_s=0.0, elevation_rad=0.7)
    squares = []
    for k in range(60):
        tones = segment_tones(running.step(float(k), TRUE, [station])[0], 0.0)
        steps = 0.5 * np.diff(np.unwrap(np.angle(tones[:, 0] * tones[:, 2])))
        squares.append(np.mean(steps**2))
    expected = 2.0 * np.pi * (satellite_hz + station_hz) * SIGNAL.segment_s * 2.0 / 3.0
    assert np.mean(squares) == pytest.approx(expected, rel=0.12)


def test_a_station_is_served_from_the_lowest_elevation_on() -> None:
    lowest = TripulseSourceParams().elevation_min_rad
    source().step(0.0, TRUE, [line(elevation_rad=lowest + 1e-9)])
    with pytest.raises(ValueError, match="sees the satellite at elevation_rad"):
        source().step(0.0, TRUE, [line(elevation_rad=lowest - 1e-9)])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"range_rate_m_s": np.nan}, "range_rate_m_s"),
        ({"elevation_rad": np.inf}, "elevation_rad"),
        ({"direction": np.array([0.0, 0.6, 0.8]) * (1.0 + 1.2e-6)}, "length of direction"),
        ({"direction": np.array([0.0, 0.6, 0.8]) * (1.0 - 1.2e-6)}, "length of direction"),
        ({"direction": np.array([0.6, 0.8])}, "direction has shape"),
    ],
)
def test_a_line_of_sight_that_is_none_is_refused(changes: dict[str, object], words: str) -> None:
    good = {"name": "a", "direction": [0.0, 0.6, 0.8], "range_rate_m_s": 0.0, "elevation_rad": 0.5}
    assert isinstance(StationLine(**good).direction, np.ndarray)  # type: ignore[arg-type]
    StationLine(**{**good, "direction": np.array([0.0, 0.6, 0.8]) * (1.0 + 0.9e-6)})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=words):
        StationLine(**{**good, **changes})  # type: ignore[arg-type]


def test_a_station_in_the_plane_of_the_array_is_behind_it_for_truth_and_steering() -> None:
    flat = StationLine(name="a", direction=np.array([0.6, 0.8, 0.0]), range_rate_m_s=0.0, elevation_rad=0.7)
    tilted = Rotation.from_rotvec([0.1, 0.0, 0.0]).as_matrix()
    with pytest.raises(ValueError, match=r"behind the array in its attitude: z=0\.0 must be > 0"):
        source().step(0.0, np.eye(3), [flat])
    with pytest.raises(ValueError, match=r"behind the array in its prior attitude: z=0\.0 must be > 0"):
        source().step(0.0, tilted, [flat])
    both = TripulseSource(ARRAY, SIGNAL, TripulseSourceParams(), seed=3, prior=tilted)
    assert both.step(0.0, tilted, [flat])[0].steering == pytest.approx((tilted @ flat.direction)[:2])


def test_a_refused_step_is_no_step() -> None:
    running = source()
    with pytest.raises(ValueError, match="behind the array"):
        running.step(5.0, TRUE, [line(), line(behind=True)])
    assert running.step(1.0, TRUE, [line()])[0].sequence == 1
    with pytest.raises(ValueError, match=r"t_s=0\.5 must be > the last frames' 1\.0"):
        running.step(0.5, TRUE, [line()])
    with pytest.raises(ValueError, match="t_s"):
        running.step(np.nan, TRUE, [line()])
