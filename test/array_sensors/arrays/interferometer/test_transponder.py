import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan
from rf_pointing.array_sensors.arrays.interferometer.transponder import (
    antennas_for_cone,
    choose_transponder,
    frequency_conflicts,
    range_rate_from_offsets,
)


def test_the_reports_choice_is_the_carrier_repeater_and_a_code_only_against_interference() -> None:
    assert choose_transponder(interference=False).name == "multiple-carrier CW repeater"
    assert choose_transponder(interference=True).name == "coherent PN transponder"
    assert choose_transponder(interference=True, widest_input_hz=1e7).name == "SAW/clipper PN transponder"
    with pytest.raises(ValueError, match="leaves no transponder"):
        choose_transponder(interference=False, widest_input_hz=5.0)


def test_a_45_degree_cone_leaves_dipole_and_slot_and_stowing_only_the_slot() -> None:
    assert [a.name for a in antennas_for_cone(45.0)] == ["crossed dipole", "crossed slot"]
    assert [a.name for a in antennas_for_cone(45.0, flush=True)] == ["crossed slot"]
    assert len(antennas_for_cone(15.0)) == 3


def test_the_reports_return_link_lies_in_the_shuttle_band_it_says_to_avoid() -> None:
    assert frequency_conflicts(CarrierPlan()) == ("return carriers in shuttle S-band",)
    assert frequency_conflicts(CarrierPlan(return_hz=2.35e9)) == ()
    assert "forward carriers in GPS L1" in frequency_conflicts(CarrierPlan(return_hz=2.35e9, forward_hz=1.574e9))


def test_differencing_received_frequencies_leaves_doppler_without_the_oscillator_offset() -> None:
    plan, rate, offset = CarrierPlan(), -7.5, 1234.0
    mean = 0.5 * (plan.forward_carriers_hz + plan.return_carriers_hz)
    received = offset - mean * rate / plan.speed_of_light_m_s
    found = range_rate_from_offsets(received, plan)
    assert found[0] == pytest.approx(rate, abs=1e-6)
    assert found[1] == pytest.approx(offset, abs=1e-5)


def test_missing_frequencies_are_refused() -> None:
    with pytest.raises(ValueError, match="offsets_hz has shape"):
        range_rate_from_offsets(np.zeros(4), CarrierPlan())
