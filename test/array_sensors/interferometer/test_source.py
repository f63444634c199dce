import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.coupling import coupling_amplitudes
from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler, frame_rotation
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem, Schedule, path_lengths
from rf_pointing.papers.interferometer_simulation import carrier_phases

SYSTEM = InterferometerSystem(schedule=Schedule(order="ascending"))
LOUD = RadioParams(forward_power_w=1e6, return_power_w=1e6, phase_noise_rad=0.0)


def motion(position=(300.0, 20.0, -10.0), attitude=None) -> RelativeMotion:
    return RelativeMotion(
        position_m=np.array(position),
        velocity_m_s=np.array([-0.6, 0.3, 0.1]),
        attitude=attitude_from_euler(0.1, -0.2, 0.3) if attitude is None else attitude,
        rate_rad_s=np.array([0.01, 0.02, -0.015]),
    )


def source(radio=LOUD, seed=3, system=SYSTEM, **options) -> InterferometerSource:
    return InterferometerSource(system, radio, LinkParams(), seed, **options)


def test_every_carrier_sees_the_target_where_it_is_in_its_own_slot() -> None:
    now = motion()
    measured = source().measure(5.0, now)
    assert measured.locked.all()
    for slot, offset in enumerate(np.linspace(-0.4, 0.4, 9)):
        attitude = frame_rotation(offset * now.rate_rad_s) @ now.attitude
        lengths = path_lengths(now.position_m + offset * now.velocity_m_s, attitude, SYSTEM.arrays)
        expected = carrier_phases(lengths[0, 0], lengths[1:, 1:], SYSTEM.plan)[slot]
        off = np.angle(np.exp(1j * (measured.phase_rad[slot] - expected)))
        assert np.max(np.abs(off)) < 1e-5


def test_phase_rates_are_the_derivative_of_the_phases() -> None:
    now, step = motion(), 1e-4
    measured = source(system=InterferometerSystem(schedule=Schedule(order="simultaneous"))).measure(0.0, now)
    ends = []
    for sign in (1, -1):
        attitude = frame_rotation(sign * step * now.rate_rad_s) @ now.attitude
        lengths = path_lengths(now.position_m + sign * step * now.velocity_m_s, attitude, SYSTEM.arrays)
        ends.append(carrier_phases(lengths[0, 0], lengths[1:, 1:], SYSTEM.plan))
    np.testing.assert_allclose(measured.phase_rate_rad_s, (ends[0] - ends[1]) / (2 * step), atol=1e-3)


def test_amplitudes_carry_the_excitation() -> None:
    now = motion()
    measured = source(excitation=(0.7, 1.2)).measure(0.0, now)
    direction = now.position_m / np.linalg.norm(now.position_m)
    expected = coupling_amplitudes(direction, now.attitude) * [0.7, 1.2]
    np.testing.assert_allclose(measured.amplitudes, expected, atol=1e-6)


def test_same_seed_same_run_and_a_restored_source_continues_identically() -> None:
    first, second = source(RadioParams()), source(RadioParams())
    first.measure(0.0, motion())
    kept = first.state
    following = first.measure(2.0, motion())
    second.restore(kept)
    resumed = second.measure(2.0, motion())
    for name in ("phase_rad", "phase_rate_rad_s", "amplitudes"):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(following, name))
    other = source(RadioParams(), seed=4).measure(0.0, motion())
    assert not np.array_equal(other.phase_rad, following.phase_rad)


def test_hardware_phases_stay_through_the_run() -> None:
    radio = LOUD.replace(hardware_phase_rad=0.1)
    biased, clean = source(radio), source()
    offsets = [
        np.angle(np.exp(1j * (biased.measure(t, motion()).phase_rad - clean.measure(t, motion()).phase_rad)))
        for t in (0.0, 9.0)
    ]
    np.testing.assert_allclose(offsets[0], offsets[1], atol=1e-5)
    assert np.std(offsets[0]) == pytest.approx(0.1, rel=0.35)


@pytest.mark.parametrize(
    "lost",
    [motion(position=(-300.0, 20.0, 0.0)), motion(attitude=attitude_from_euler(np.pi, 0.0, 0.0))],
    ids=["behind the active array", "passive array looks away"],
)
def test_arrays_that_do_not_face_each_other_have_no_lock_and_random_phases(lost: RelativeMotion) -> None:
    maker = source()
    first, second = maker.measure(0.0, lost), maker.measure(1.0, lost)
    assert not first.locked.any()
    off = np.angle(np.exp(1j * (first.phase_rad - second.phase_rad)))
    assert np.std(off) > 1.0


def test_links_below_10_db_lose_lock() -> None:
    weak = source(RadioParams(return_power_w=5e-4)).measure(0.0, motion(position=(1e5, 0.0, 0.0)))
    assert not weak.locked.any()
    assert np.max(weak.snr_return) < 10.0


def test_undefined_input_is_refused() -> None:
    with pytest.raises(ValueError, match=r"excitation=\(0.0, 1.0\) must be finite and > 0"):
        source(excitation=(0.0, 1.0))
    with pytest.raises(ValueError, match="t_s=inf"):
        source().measure(float("inf"), motion())
    with pytest.raises(ValueError, match="reflection"):
        source().measure(0.0, motion(attitude=np.diag([1.0, 1.0, -1.0])))


def test_a_loop_that_lost_lock_does_not_change_the_noise_that_follows() -> None:
    weak, sound = source(RadioParams(return_power_w=1e-9)), source(RadioParams())
    weak.measure(0.0, motion())
    sound.measure(0.0, motion())
    assert weak.state == sound.state
    lost = weak.measure(1.0, motion())
    assert not lost.locked.any()
    assert np.std(lost.phase_rate_rad_s) == pytest.approx(1e3, rel=0.35)
    assert np.all((lost.phase_rad >= 0.0) & (lost.phase_rad < 2.0 * np.pi))
    assert np.ptp(lost.phase_rad) > 5.5
