"""The stepped filter: verdict with reasons, refusals that change nothing, resume, and a start by Wahba's problem."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams, start_state, update
from rf_pointing.array_sensors.attitude.quaternion import (
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    rotation_angle_between_rad,
)
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams
from rf_pointing.array_sensors.doa import attitude_filter
from rf_pointing.array_sensors.doa.attitude_filter import (
    DoaAttitudeFilter,
    DoaAttitudeParams,
    DoaAttitudeState,
    SharedDirections,
    StationDirection,
)
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams

ORBIT_RATE = np.array([0.0, -1.038e-3, 0.0])
NONE = KnownTorque(control_n_m=np.zeros(3), wheel_momentum_n_m_s=np.zeros(3), wheel_momentum_rate_n_m=np.zeros(3))
TRUTH = quaternion_from_rotation_vector([0.3, -0.5, 0.2])
SIGMA = 0.004


def doa_filter(**changes: float) -> DoaAttitudeFilter:
    return DoaAttitudeFilter(
        SatelliteParams(), DoaAttitudeParams(**changes), StartParams(), ProcessNoiseParams(),
        GateParams(), WatchParams(), t_s=0.0, quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
        rate_rad_s=quaternion_to_matrix(TRUTH).T @ ORBIT_RATE,
    )  # fmt: skip


def direction(station: str, reference: list[float], sigma: float = SIGMA) -> StationDirection:
    towards = np.array(reference) / np.linalg.norm(reference)
    measured = quaternion_to_matrix(TRUTH).T @ towards
    covariance = sigma**2 * (np.eye(3) - np.outer(measured, measured))
    return StationDirection(station=station, measured=measured, covariance_rad2=covariance, reference=towards)


AHEAD, ASIDE = direction("ahead", [0.7, 0.1, 0.7]), direction("aside", [-0.2, 0.8, 0.6])


def started(running: DoaAttitudeFilter, rate_rad_s: np.ndarray | None = None) -> None:
    """Let the filter know the truth as two directions tell it, without hypotheses."""
    rate = np.zeros(3) if rate_rad_s is None else rate_rad_s
    bank = start_state(TRUTH[None], rate[None], 0.1, 0.01, GateParams())
    for seen in (AHEAD, ASIDE):
        bank = update(bank, seen, GateParams())
    running.restore(DoaAttitudeState(t_s=0.0, bank=bank, heard_s=0.0, stations=("ahead", "aside")))


def test_output_says_why_it_is_not_valid() -> None:
    running = doa_filter(silence_s=10.0)
    assert running.output().reason == "no direction accepted yet"
    running.observe(AHEAD)
    assert "1 of 2 stations received" in running.output().reason
    assert "12 hypotheses of the start still open" in running.output().reason
    assert "attitude sigma" in running.output().reason
    started(running, ORBIT_RATE)
    assert running.output().valid
    running.predict_to(11.0, NONE, ORBIT_RATE)
    assert "no direction for 11 s" in running.output().reason


@pytest.mark.parametrize(("longest", "again"), [(attitude_filter.LONGEST_START, True), (50, False)])
def test_decided_start_is_gone_through_again_and_its_innovations_are_tested(
    monkeypatch: pytest.MonkeyPatch, longest: int, again: bool
) -> None:
    monkeypatch.setattr(attitude_filter, "LONGEST_START", longest)
    running, decided_s = doa_filter(), None
    for k in range(45):
        running.predict_to(1.0 * k, NONE, ORBIT_RATE)
        for seen in (AHEAD, ASIDE):
            open_before = len(running.state.bank.misfit) != 1 or running.state.heard_s is None
            running.observe(seen)
            if open_before and len(running.state.bank.misfit) == 1:
                decided_s = k
        # A direction of each station and a step each second; nothing is kept after the decision.
        noted = 3 * k + 2 if decided_s is None else 0
        assert len(running.state.start) == (noted if noted <= longest else 0)
    assert decided_s == StartParams().settle_s
    # The longest memory of the watch, 500 directions: those of the start or those since.
    directions = 2 * 45 if again else 2 * (45 - decided_s) - 1
    fading = 1.0 - 1.0 / max(WatchParams().directions)
    assert running.state.watches[attitude_filter.EVERY_STATION].weight[-1] == pytest.approx(
        (1.0 - fading**directions) / (1.0 - fading), rel=0.02
    )
    assert running.state.t_s == 44.0
    assert running.state.stations == ("ahead", "aside")
    assert float(rotation_angle_between_rad(running.output().quaternion, TRUTH)) < 0.02


def test_directions_that_keep_missing_put_the_attitude_in_doubt() -> None:
    running = doa_filter()
    started(running)
    for _ in range(200):
        running.observe(AHEAD)
        running.observe(ASIDE)
    turned = replace(AHEAD, measured=ASIDE.measured, covariance_rad2=ASIDE.covariance_rad2)
    assert [running.observe(turned) for _ in range(9)] == [False] * 9
    assert "outside the gate" in running.output().reason


def test_station_that_is_elsewhere_is_named_although_another_cancels_it() -> None:
    running, stream = doa_filter(), np.random.default_rng(8)
    rate = quaternion_to_matrix(TRUTH).T @ ORBIT_RATE
    started(running, rate)
    normal = np.cross(AHEAD.reference, ASIDE.reference)
    turns = {"ahead": 0.6 * SIGMA * normal / np.linalg.norm(normal), "aside": np.zeros(3)}
    turns["aside"] = -turns["ahead"]
    for _ in range(150):
        for seen in (AHEAD, ASIDE):
            # Each is off in the plane of both, towards the other: no attitude explains that.
            axis = turns[seen.station] + SIGMA * stream.standard_normal(3)
            turned = quaternion_to_matrix(quaternion_from_rotation_vector(axis)) @ seen.reference
            running.observe(replace(seen, measured=quaternion_to_matrix(TRUTH).T @ turned))
    reason = running.output().reason
    assert "ahead: innovations have a common mean" in reason
    assert "aside: innovations have a common mean" in reason
    assert not reason.startswith("innovations have")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"measured": np.array([np.nan, 0.0, 1.0])}, "measured"),
        ({"measured": np.array([0.0, 0.0, 1.1])}, "measured"),
        ({"reference": np.array([0.0, 0.0, 0.0])}, "reference"),
        ({"covariance_rad2": -np.eye(3)}, "eigenvalues"),
        ({"covariance_rad2": np.zeros((3, 3))}, "eigenvalues"),
        ({"covariance_rad2": np.full((3, 3), np.inf)}, "covariance_rad2"),
    ],
)
def test_unusable_direction_is_refused_and_changes_nothing(changes: dict[str, np.ndarray], words: str) -> None:
    running = doa_filter()
    before = running.state
    with pytest.raises(ValueError, match=words):
        running.observe(replace(AHEAD, **changes))
    assert running.state is before


@pytest.mark.parametrize(
    ("t_s", "known", "words"),
    [
        (-1.0, NONE, "must be >= the filter's time"),
        (np.nan, NONE, "t_s=nan must be finite"),
        (1.0, replace(NONE, control_n_m=np.array([np.nan, 0.0, 0.0])), "control_n_m"),
    ],
)
def test_unusable_prediction_is_refused_and_changes_nothing(t_s: float, known: KnownTorque, words: str) -> None:
    running = doa_filter()
    before = running.state
    with pytest.raises(ValueError, match=words):
        running.predict_to(t_s, known, ORBIT_RATE)
    assert running.state is before


def test_non_unit_start_is_refused() -> None:
    with pytest.raises(ValueError, match="norm"):
        DoaAttitudeFilter(
            SatelliteParams(), DoaAttitudeParams(), StartParams(), ProcessNoiseParams(),
            GateParams(), WatchParams(), t_s=0.0, quaternion=np.array([0.0, 0.0, 0.0, 2.0]),
            rate_rad_s=np.zeros(3),
        )  # fmt: skip


def test_resuming_from_the_state_gives_the_same_output() -> None:
    running = doa_filter()
    running.observe(AHEAD)
    resumed = doa_filter()
    resumed.restore(running.state)
    for each in (running, resumed):
        each.predict_to(0.6, NONE, ORBIT_RATE)
        each.observe(ASIDE)
    assert np.array_equal(running.output().quaternion, resumed.output().quaternion)
    assert np.array_equal(running.output().covariance, resumed.output().covariance)


def together(*directions: StationDirection, order: tuple[int, ...]) -> SharedDirections:
    """Return what one channel shows of the stations: their directions in another order."""
    return SharedDirections(
        measured=np.array([directions[k].measured for k in order]),
        covariance_rad2=np.array([directions[k].covariance_rad2 for k in order]),
        stations=tuple(each.station for each in directions),
        reference=np.array([each.reference for each in directions]),
    )


ABOVE = direction("above", [0.1, -0.7, 0.9])


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2), (2,)])
def test_directions_of_one_channel_are_given_to_the_stations_they_come_from(order: tuple[int, ...]) -> None:
    shared, alone = doa_filter(), doa_filter()
    for running in (shared, alone):
        started(running)
    stations = (AHEAD, ASIDE, ABOVE)
    assert shared.observe_shared(together(*stations, order=order)) == order
    assert [alone.observe(stations[k]) for k in order] == [True] * len(order)
    np.testing.assert_allclose(shared.output().quaternion, alone.output().quaternion, atol=1e-12)
    np.testing.assert_allclose(shared.output().covariance, alone.output().covariance, rtol=1e-9, atol=1e-20)
    names = ("ahead", "aside", "above")
    assert shared.state.stations == ("ahead", "aside", *(("above",) if 2 in order else ()))
    assert set(shared.state.watches) == {"", *(names[k] for k in order)}


def test_a_start_from_one_channel_of_three_stations_tries_each_as_the_origin_of_the_first_direction() -> None:
    running = doa_filter()
    heard = together(AHEAD, ASIDE, ABOVE, order=(1, 2, 0))
    running.observe_shared(heard)
    assert len(running.state.bank.misfit) == 3 * StartParams().hypotheses
    for k in range(1, 50):
        running.predict_to(1.0 * k, NONE, ORBIT_RATE)
        running.observe_shared(heard)
    assert running.observe_shared(heard) == (1, 2, 0)
    assert len(running.state.bank.misfit) == 1
    assert float(rotation_angle_between_rad(running.output().quaternion, TRUTH)) < 0.02
    assert running.refused == 0


def test_a_direction_of_no_station_of_the_channel_is_left_out_and_never_believed() -> None:
    """However often it comes: a filter in doubt would take the wrong station's."""
    running = doa_filter()
    started(running)
    before = running.output()
    turned = replace(AHEAD, measured=ABOVE.measured, covariance_rad2=ABOVE.covariance_rad2)
    for _ in range(12):
        assert running.observe_shared(together(turned, order=(0,))) == ()
    assert running.refused == 12
    np.testing.assert_allclose(running.output().quaternion, before.quaternion, atol=1e-12)
    assert running.observe_shared(together(AHEAD, order=())) == ()
    assert running.state.heard_s == 0.0


def test_doubts_begin_at_their_bounds() -> None:
    running = doa_filter(silence_s=10.0, stations=2)
    started(running, quaternion_to_matrix(TRUTH).T @ ORBIT_RATE)
    running.predict_to(10.0, NONE, ORBIT_RATE)
    assert "no direction" not in running.output().reason
    running.predict_to(10.1, NONE, ORBIT_RATE)
    assert "no direction for 10 s, must be <= 10 s" in running.output().reason
    for stations, valid in ((2, True), (3, False)):
        other = doa_filter(stations=stations)
        started(other)
        assert other.output().valid is valid
    sigma = float(np.sqrt(np.linalg.eigvalsh(other.output().covariance[:3, :3])[-1]))
    for share, valid in ((1.01, True), (0.99, False)):
        narrow = doa_filter(sigma_rad=share * sigma)
        started(narrow)
        assert narrow.output().valid is valid
    assert "attitude sigma" in narrow.output().reason


@pytest.mark.parametrize("elapsed_s", [0.25, 0.26, 0.5, 0.6])
def test_steps_are_equal_and_none_is_longer_than_stated(elapsed_s: float) -> None:
    count = int(np.ceil(elapsed_s / 0.25))
    once, often = doa_filter(), doa_filter()
    for each in (once, often):
        started(each, np.array([0.05, -0.04, 0.08]))
    once.predict_to(elapsed_s, NONE, ORBIT_RATE)
    for k in range(1, count + 1):
        often.predict_to(elapsed_s * k / count, NONE, ORBIT_RATE)
    np.testing.assert_allclose(once.output().covariance, often.output().covariance, rtol=1e-9, atol=1e-18)
    longer = doa_filter(step_s=1.0)
    started(longer, np.array([0.05, -0.04, 0.08]))
    longer.predict_to(elapsed_s, NONE, ORBIT_RATE)
    same = np.allclose(longer.output().covariance, once.output().covariance, rtol=1e-6, atol=0.0)
    assert same is (count == 1)


def test_one_direction_of_a_channel_of_three_stations_starts_a_bank_for_each() -> None:
    running = doa_filter()
    running.observe_shared(together(AHEAD, ASIDE, ABOVE, order=(1,)))
    bank = running.state.bank
    assert len(bank.misfit) == 36
    # A third of them has the direction at each of the stations.
    turned = np.einsum("nij,j->ni", quaternion_to_matrix(bank.quaternion), ASIDE.measured)
    for station in (AHEAD, ASIDE, ABOVE):
        assert np.sum(np.linalg.norm(turned - station.reference, axis=1) < 1e-6) == 12


def test_the_first_direction_is_contact_and_later_ones_only_inside_the_gate() -> None:
    running = doa_filter()
    started(running, quaternion_to_matrix(TRUTH).T @ ORBIT_RATE)
    assert running.state.heard_s == 0.0
    running.predict_to(1.0, NONE, ORBIT_RATE)
    assert running.observe(AHEAD)
    assert (running.state.heard_s, running.refused) == (1.0, 0)
    running.predict_to(2.0, NONE, ORBIT_RATE)
    assert not running.observe(replace(AHEAD, measured=ASIDE.measured, covariance_rad2=ASIDE.covariance_rad2))
    assert (running.state.heard_s, running.refused) == (1.0, 1)
    fresh = doa_filter()
    assert (fresh.state.heard_s, fresh.refused) == (None, 0)
    fresh.predict_to(3.0, NONE, ORBIT_RATE)
    fresh.observe(AHEAD)
    assert (fresh.state.heard_s, fresh.state.stations) == (3.0, ("ahead",))
