"""Two-port noise: the definition, the optimum, and the published device temperatures."""

import math

import pytest

from rf_pointing.core import random_stream
from rf_pointing.papers.hemt import HemtParams, TwoPortNoise, cascade_noise_k

T0 = 290.0


def planted(seed: int) -> TwoPortNoise:
    rng = random_stream(seed, "two-port")
    r = rng.uniform(0.0, 0.95) * complex(math.cos(a := rng.uniform(0.0, 6.28)), math.sin(a))
    return TwoPortNoise(rng.uniform(1.0, 80.0), rng.uniform(1e-4, 2e-2), r)


@pytest.mark.parametrize("seed", range(6))
def test_noise_temperature_is_the_noise_of_both_sources_over_that_of_the_generator(seed: int) -> None:
    device = planted(seed)
    for generator in (50 + 0j, 20 - 35j, 110 + 60j):
        # <|e + Zg i|^2> / (4 k B Rg) with <e* i> = 4 k T0 B C.
        power = (
            device.resistance_ohm + abs(generator) ** 2 * device.conductance_s + 2.0 * (generator * device.product).real
        )
        assert device.noise_k(generator) == pytest.approx(T0 * power / generator.real, rel=1e-10)


@pytest.mark.parametrize("seed", range(6))
def test_noise_is_least_at_the_best_impedance_and_finite_there(seed: int) -> None:
    device = planted(seed)
    best = device.best_impedance_ohm
    assert device.noise_k(best) == pytest.approx(device.least_noise_k, rel=1e-12)
    for step in (1.0, -0.5, 2j, -1j):
        assert device.noise_k(best + step) > device.least_noise_k


def test_low_frequency_limit_is_the_papers_closed_form() -> None:
    params = HemtParams(gate_k=12.0, drain_k=600.0)
    frequency = 1e9
    device = TwoPortNoise.of_hemt(params, frequency)
    ratio = frequency / params.transition_hz
    noise = 2.0 * ratio * math.sqrt(params.drain_conductance_s * 600.0 * params.gate_resistance_ohm * 12.0)
    best = math.sqrt(params.gate_resistance_ohm * 12.0 / (params.drain_conductance_s * 600.0)) / ratio
    assert device.least_noise_k == pytest.approx(noise, rel=0.04)
    assert device.best_impedance_ohm.real == pytest.approx(best, rel=0.002)
    reactance = 1.0 / (2.0 * math.pi * frequency * params.gate_source_capacitance_f)
    assert device.best_impedance_ohm.imag == pytest.approx(reactance, rel=1e-9)
    assert device.conductance_s == pytest.approx(noise / (2.0 * best * T0), rel=0.01)


def test_noise_of_a_chip_is_that_of_its_gate_and_of_the_drain_current_through_it() -> None:
    params = HemtParams(gate_resistance_ohm=4.0, gate_k=29.0, drain_k=580.0)
    frequency = 2.0 * params.transition_hz
    device = TwoPortNoise.of_hemt(params, frequency)
    conductance = 4.0 * params.drain_conductance_s * 2.0
    reactance = 1.0 / (2.0 * math.pi * frequency * params.gate_source_capacitance_f)
    assert device.conductance_s == pytest.approx(conductance, rel=1e-12)
    assert device.resistance_ohm == pytest.approx(0.4 + conductance * (16.0 + reactance**2), rel=1e-12)
    assert device.product == pytest.approx(conductance * complex(4.0, reactance), rel=1e-12)


def test_sources_that_are_wholly_correlated_through_a_reactance_are_best_without_resistance() -> None:
    device = TwoPortNoise(0.5, 2e-3, 1j)
    assert device.best_impedance_ohm == pytest.approx(complex(0.0, math.sqrt(250.0)), abs=1e-6)
    rounded = TwoPortNoise(0.7, 3e-3, 1.0j)
    assert rounded.best_impedance_ohm.real < 1e-6


@pytest.mark.parametrize(
    ("resistance_ohm", "conductance_s", "words"),
    [(-1e-3, 1e-3, "resistance_ohm=-0.001 must be >= 0"), (1.0, 0.9e-15, "conductance_s=9e-16 must be >= 1e-15")],
)
def test_negative_sources_are_refused(resistance_ohm: float, conductance_s: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        TwoPortNoise(resistance_ohm, conductance_s, 0.0)
    assert TwoPortNoise(0.0, 1.1e-15, 0.0).least_noise_k == 0.0


def test_default_chip_is_in_the_range_of_the_published_cryogenic_devices() -> None:
    # HEMT table 1, device A at 13 K: 5.3 K at 8.5 GHz.
    assert TwoPortNoise.of_hemt(HemtParams(), 8.5e9).least_noise_k == pytest.approx(5.3, rel=0.6)


def test_cascade_of_two_stages_is_friis() -> None:
    assert cascade_noise_k([(35.0, 16.5), (350.0, 20.0)]) == pytest.approx(35.0 + 350.0 / 10.0**1.65, rel=1e-12)


def test_correlation_above_one_is_refused() -> None:
    with pytest.raises(ValueError, match=r"correlation=.* must be <= 1.0"):
        TwoPortNoise(10.0, 1e-3, 1.1 + 0j)


def test_generator_without_resistance_is_refused() -> None:
    with pytest.raises(ValueError, match=r"generator resistance=0.0 must be >= 1e-09"):
        planted(0).noise_k(30j)


def test_stage_of_negative_noise_is_refused() -> None:
    with pytest.raises(ValueError, match=r"noise_k=-1.0 must be >= 0"):
        cascade_noise_k([(0.0, 10.0), (-1.0, 10.0)])
