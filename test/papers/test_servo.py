"""The parts the servo rows are made of, against closed forms and each other."""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.signal import lsim

from rf_pointing.controllers import dss13_loops
from rf_pointing.controllers.margins import encircles_not
from rf_pointing.papers.servo_linear import closed_loop, stability_limit_hz
from rf_pointing.papers.servo_monopulse import PLAIN
from rf_pointing.papers.servo_pass import PassSetup, fly
from rf_pointing.papers.servo_sampled import LawResponse, loop_quality, sampled_axis
from rf_pointing.servo import GustFilter, discretise, dss13_plant
from rf_pointing.servo.wind import GUST_LENGTH_M
from rf_pointing.station.antenna.axis_response import Variation, davenport_psd


@pytest.fixture(scope="module")
def plant():
    return dss13_plant(ideal=True)


def test_stability_limit_is_where_the_loop_turns_unstable(plant) -> None:
    limit = stability_limit_hz(plant, (PLAIN, PLAIN), 1)
    assert closed_loop(plant, (PLAIN, PLAIN), (0.0, 0.999 * limit)).stable()
    assert not closed_loop(plant, (PLAIN, PLAIN), (0.0, 1.001 * limit)).stable()


def test_flown_pass_agrees_with_the_exact_linear_response(plant) -> None:
    setup = PassSetup(plant=plant, loops=(PLAIN, PLAIN), start_s=-400.0, end_s=-370.0, settled=False)
    flown = fly(setup)
    motion = setup.orbit.at(-400.0 + 0.02 * np.arange(1501))
    system = closed_loop(plant, (PLAIN, PLAIN))
    inputs = np.zeros((1501, 8))
    inputs[:, :2], inputs[:, 2:4] = motion.position_rad, motion.velocity_rad_s
    start = np.zeros(len(system.a))
    start[:2] = motion.position_rad[0]
    state_space = (system.a, system.b, system.beam, np.zeros((2, 8)))
    exact = motion.position_rad - lsim(state_space, inputs, 0.02 * np.arange(1501), start)[1]
    largest = np.max(np.abs(exact[:, 1]))
    np.testing.assert_allclose(flown.beam_rad[:, 1], exact[1:, 1], atol=0.06 * largest)


@pytest.mark.parametrize("gains", ["published", "tuned"])
def test_wind_error_of_the_frequency_domain_is_that_of_the_covariance_equation(plant, gains: str) -> None:
    """Same loop, two methods: integral over the spectrum, and the stationary covariance of the sampled system."""
    import scipy.linalg

    law = dss13_loops(gains)[1]
    response = sampled_axis(plant, 1, Variation())
    quality = loop_quality(response, LawResponse(law), None, 8.0)
    gust = GustFilter.davenport(8.0, 0.005)
    decay, factor = gust.step_matrices(0.02)
    step = discretise(response.a, np.hstack([response.command, response.wind]), 0.02)
    size = len(response.a)
    a, command, wind = step[:, :size], step[:, size : size + 1], step[:, size + 1 :]
    la, lb, lc, ld = law.matrices(0.02)
    shown = response.outputs[:1]
    closed = np.block([[a - command @ ld @ shown, command @ lc], [-lb @ shown, la]])
    total = len(closed)
    whole = np.zeros((total + 4, total + 4))
    whole[:total, :total], whole[:size, total:] = closed, wind @ gust.residues[None]
    whole[total:, total:] = np.diag(decay)
    noise = np.zeros_like(whole)
    noise[total:, total:] = factor @ factor.T
    covariance = scipy.linalg.solve_discrete_lyapunov(whole, noise)
    beam = np.concatenate([response.outputs[1], np.zeros(total + 4 - size)])
    assert math.sqrt(beam @ covariance @ beam) == pytest.approx(quality.rms_s2_per_m_s, rel=0.04)


def test_a_loop_that_stays_stable_has_the_highest_bandwidth_scanned(plant) -> None:
    assert stability_limit_hz(plant, (PLAIN, PLAIN), 1, highest_hz=0.02) == 0.02


def test_a_delayed_integrator_turns_unstable_at_a_quarter_period_of_delay() -> None:
    """k / s e^(-T s) encircles -1 from k T = pi / 2 on."""
    frequency = np.geomspace(1e-3, 24.0, 4000)
    s = 2j * np.pi * frequency
    for gain, stable in ((0.95, True), (1.05, False)):
        assert encircles_not(gain * 0.5 * math.pi / 0.3 / s * np.exp(-0.3 * s)) is stable


def test_gusts_have_davenports_spectrum_and_the_variance_of_its_integral() -> None:
    # x = 1 at v / L: 4 kappa v L / 2^(4/3).
    knee = 8.0 / GUST_LENGTH_M
    psd = davenport_psd(np.array([knee]), 8.0, 0.005)
    assert psd[0] == pytest.approx(4.0 * 0.005 * 8.0 * GUST_LENGTH_M / 2.0 ** (4.0 / 3.0))
    frequency = np.geomspace(1e-7, 1e4, 20_000)
    # The integral of 4 kappa v^2 x / (1 + x^2)^(4/3) over x is 6 kappa v^2.
    assert trapezoid(davenport_psd(frequency, 8.0, 0.005), frequency) == pytest.approx(6.0 * 0.005 * 64.0, rel=0.01)
