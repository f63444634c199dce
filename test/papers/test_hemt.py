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
