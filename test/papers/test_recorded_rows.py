"""Tables that cost little, row by row as recorded: published number, tolerance, ours, whether it holds, the remark."""

import math
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.controllers import PositionLoopParams
from rf_pointing.core import AXES, MDEG, random_stream
from rf_pointing.identification import CrossCheck, StraightCheck
from rf_pointing.papers import (
    conscan,
    doa,
    interferometer,
    interferometer_claims,
    interferometer_simulation,
    monopulse,
    satcal,
    servo_feedforward,
    servo_identification,
    servo_monopulse,
    servo_wind,
    tripulse,
    tripulse_attitude,
    tripulse_noise,
)
from rf_pointing.papers.doa_study.attitude_runs import CaseResult, RunTask
from rf_pointing.papers.monopulse_dropouts import AutotrackRadio
from rf_pointing.papers.monopulse_loop import MonopulsePass, PlainRadio
from rf_pointing.papers.orbit.measurements import visits
from rf_pointing.papers.orbit.motion import Gravity
from rf_pointing.papers.row import Row
from rf_pointing.papers.satcal_campaign import (
    APRIL_T_S,
    IRS_P3_APRIL,
    ORBIT_PRIORS,
    SITES,
    many_runs,
    model_of,
    points_of,
)
from rf_pointing.papers.satcal_orbit import BatchCheck, PreliminaryCheck
from rf_pointing.papers.servo_pass import PassErrors, PassSetup
from rf_pointing.servo import dss13_plant
from test.papers.doa_study.test_recorded_study import planted
from test.papers.recorded import DATA, changed, check_rows, mark


def monopulse_fly(setup: MonopulsePass, radio: PlainRadio | AutotrackRadio) -> SimpleNamespace:
    loop, plant, integrator = setup.loop, setup.plant, radio._integrator.params
    one = mark(setup.start_s, setup.end_s, setup.late_s, setup.wind_m_s, setup.settle_s, setup.seed)
    other = mark(loop.proportional_gain, loop.notch_enabled, integrator.bandwidth_hz, radio._level_db_hz)
    third = mark(plant == dss13_plant(ideal=True))
    if isinstance(radio, PlainRadio):
        radio.fault, radio.fault_s = "turned", 41.0 + 0.1 * mark(radio._flip_s)
    else:
        radio.modes = [(radio._ephemeris.t_s[0], "search"), (radio._dropouts.stop_s[3] + other, "monopulse")]
    return SimpleNamespace(
        rms_rad=lambda settle_s: (MDEG * np.array([one, other * mark(settle_s)]), MDEG * third * one),
        command_velocity_rad_s=1e-3 * np.array([[one, 0.0], [other, one], [0.0, other]]),
        transparent=np.array([True, False]),
    )


def servo_fly(setup: PassSetup) -> PassErrors:
    laws = [
        law.notch_frequency_hz + law.notch_enabled if isinstance(law, PositionLoopParams) else 0.3
        for law in setup.loops
    ]
    size = mark(
        setup.start_s, setup.end_s, setup.bandwidth_hz, setup.radio_period_s, setup.radio_delay_s, setup.cluster,
        setup.mean_of, *setup.late_s, setup.wind.mean_speed_m_s, setup.seed, *laws,
        setup.plant.elevation.amplifier_gain,
    )  # fmt: skip
    t_s = np.arange(setup.start_s, setup.end_s, 1.0)
    error = MDEG * size * np.column_stack([np.cos(t_s), 0.7 * np.sin(t_s)])
    return PassErrors(t_s, error, error, error, error)


def bwg_monopulse() -> list[Row]:
    with changed(
        servo_monopulse,
        fly=servo_fly,
        _limit_hz=lambda beta=1.0, pinion_deg=0.0, notch_hz=0.0: 0.3 * mark(beta, pinion_deg, notch_hz),
        _peak_errors=servo_monopulse._peak_errors.__wrapped__,
    ):
        return servo_monopulse.monopulse_rows()


def bwg_feedforward() -> list[Row]:
    with changed(servo_feedforward, fly=servo_fly, _gain=list):
        return servo_feedforward.feedforward_rows()


def bwg_wind() -> list[Row]:
    few = [servo_wind.Variation(0.96, 1.3), servo_wind.Variation(1.06, 0.7)]
    with changed(servo_wind, fly=servo_fly, VARIATIONS=few):
        return servo_wind._best(3)


def bwg_radio() -> list[Row]:
    lock = ("no carrier", 1.7)
    with changed(monopulse, fly=monopulse_fly, sidelobe_lock_s=lambda _random: lock, HONESTY_RUNS=4):
        return [
            monopulse._honesty_row(1), *monopulse._bandwidth_rows(1), monopulse._wind_row(1),
            *monopulse._false_lock_rows(1), *monopulse._dropout_rows(1),
        ]  # fmt: skip


def dss13_identification() -> list[Row]:
    def studies(_recordings: object, held_out: int) -> list[SimpleNamespace]:
        checks = {
            True: [StraightCheck(error=0.001 * n, gain_factor=0.02 / n) for n in range(1, held_out + 1)],
            False: [CrossCheck(error=0.03 / n, bias=1e-6 * n) for n in range(1, held_out + 1)],
        }
        return [
            SimpleNamespace(
                driven=driven, shown=shown, checks=checks[driven == shown] + checks[driven != shown][:1],
                identified=SimpleNamespace(model=1.9 if driven == "azimuth" else 3.0),
                measured=SimpleNamespace(valid_band_hz=lambda: (0.1, 8.0)),
            )
            for driven in AXES for shown in AXES
        ]  # fmt: skip

    modes = lambda model: SimpleNamespace(frequency_hz=model * np.array([0.5, 1.0, 1.8, 3.0]))  # noqa: E731
    with changed(servo_identification, study=studies, modes_of=modes, record=lambda *_: None):
        return servo_identification.identification_rows()


def conscan_few() -> list[Row]:
    with changed(
        conscan,
        RUNS=30,
        EXACT_RUNS=200,
        HONESTY_RUNS=4,
        pull_in_rms_rad=lambda level, start, periods, _random: MDEG * mark(level, *(start / MDEG), periods),
        search_time_s=lambda angle, level, _random: 10.0 * mark(angle, level),
    ):
        return [
            *conscan._monte_carlo_rows(1), *conscan._exact_estimator_rows(1), conscan._honesty_row(1),
            *conscan._closed_loop_rows(1),
        ]  # fmt: skip


def tripulse_few() -> list[Row]:
    with changed(tripulse, TRIALS=150), changed(tripulse_attitude, FRAMES=4):
        return [*tripulse._failure_rows(1, None), *tripulse_attitude.signal_rows(1)]


def doa_tables() -> list[Row]:
    """Return the rows of the command from results of no run: which result each row is made of."""

    def run(task: RunTask) -> list[CaseResult]:
        size = mark(task.trials, task.seed, task.published, task.music_inside, task.duration_s, len(task.cases))
        return [planted(case, size * (1.0 + 0.1 * case.refined), 0.01) for case in task.cases]

    none = {
        "accuracy_rows": lambda *_: [],
        "direction_rows": lambda _: [],
        "scene_rows": list,
        "future_rows": lambda _: [],
    }
    with changed(doa, run=run, **none):
        return [*doa.rows(1, trials=3), *doa.rows(1, trials=60, music_inside=True)]


def satcal_planted() -> list[Row]:
    passes = visits(
        SITES["Sriharikota"], IRS_P3_APRIL, APRIL_T_S, 1.5, Gravity(), step_s=60.0, lowest_rad=math.radians(10.0)
    )
    points, names = (
        points_of(passes, math.radians(0.01)),
        ("azimuth_offset", "azimuth_velocity_lag", "elevation_offset"),
    )
    random = random_stream(1, "planted campaigns")
    model = model_of({"azimuth_offset": 0.4, "azimuth_velocity_lag": 0.5, "elevation_offset": -0.2})
    runs, white = (
        many_runs(points, model, names, count, random, priors) for count, priors in ((4, ORBIT_PRIORS), (3, None))
    )
    shifts = 1e-2 * np.arange(12.0).reshape(2, 6) - np.array([[20.0, 3.0, 9.0, 0.0, 0.0, 0.0]] * 2)
    check = BatchCheck(
        angle_sigma_deg=0.01, raw_shift=shifts[0], corrected_shift=0.1 * shifts[1], predicted_shift=shifts[0] + 0.2,
        range_only_sigma_m=2.0, measurements={"network": 100, "angles": 50},
    )  # fmt: skip
    errors = np.array([[15.0, 0.08], [-11.0, 0.05]])
    early = PreliminaryCheck(errors, np.array([[0.9, 0.01], [0.7, -0.02]]), (20.0, 50.0))
    with changed(satcal, preliminary_check=lambda *_: early, batch_check=lambda *_: check):
        return [
            satcal._closure(1), *satcal.coefficient_rows("Table 1", runs, "few"),
            *satcal.honesty_rows("Table 1", runs, white), *satcal.residual_rows("PCMC-1", points, runs),
            *satcal._preliminary_rows(1, runs, 2), *satcal._batch_rows(1, {"PCMC-1": runs}, passes),
        ]  # fmt: skip


TABLES: dict[str, Callable[[], list[Row]]] = {
    "PI83 Table 7-1": interferometer._table_7_1,
    "PI83 Table 8-1": interferometer._table_8_1,
    "PI83 Tables 8-2 and 8-3": interferometer._tables_8_2_and_8_3,
    "PI83 design chain": interferometer_claims.chain_rows,
    "PI83 estimators": interferometer_claims.estimator_rows,
    "PI83 links": interferometer_claims.link_rows,
    "PI83 short range": lambda: interferometer_simulation._short_range_rows(1),
    "PI83 powers": lambda: interferometer_simulation._power_rows(1),
    "TRIPULSE times": tripulse._time_rows,
    "TRIPULSE phases": lambda: tripulse._phase_rows(1),
    "TRIPULSE noise": lambda: tripulse_noise.noise_rows(1),
    "TRIPULSE beyond": lambda: tripulse_noise.future_rows(1),
    "TRIPULSE attitude": lambda: tripulse_attitude.attitude_rows(1),
    "CONSCAN slope and loss": conscan._slope_and_loss,
    "CONSCAN errors": lambda: conscan._error_rows(1),
    "CONSCAN periods": lambda: conscan._period_rows(1),
    "BWG averaging": lambda: monopulse._averaging_rows(1),
    "BWG feedforward, planted": bwg_feedforward,
    "BWG feedforward, from rest": servo_feedforward._start,
    "BWG feedforward, gain": servo_feedforward._gain,
    "BWG monopulse, planted": bwg_monopulse,
    "BWG wind rejection": servo_wind._rejection,
    "BWG wind, planted": bwg_wind,
    "BWG radio, planted": bwg_radio,
    "DSS13-ID, planted": dss13_identification,
    "CONSCAN, few runs": conscan_few,
    "TRIPULSE, few runs": tripulse_few,
    "PI83 ranges": lambda: interferometer_simulation._range_rows(1, None),
    "PI83 rolls": lambda: interferometer_simulation._roll_rows(1, None),
    "SATCAL, planted": satcal_planted,
    "DOA command, planted": doa_tables,
}


@pytest.mark.parametrize("name", TABLES)
def test_every_row_is_the_recorded_one(name: str) -> None:
    check_rows(DATA / "rows.csv", name, TABLES[name]())
