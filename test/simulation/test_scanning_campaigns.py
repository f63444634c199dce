"""A dish without monopulse calibrates itself by its scan alone, to 5 % of a beamwidth.

`benchmarks/scanning_campaigns.py` flies longer campaigns, on two antennas, with both scans.
"""

import math
from pathlib import Path
from typing import Any

import pytest

from rf_pointing.calibration import BiasModel, PassPriors
from rf_pointing.simulation import StationSetup, simulate_pass
from test.scripts import script_module

SPAN_S = 700.0


@pytest.fixture(scope="module")
def script() -> Any:
    return script_module("benchmarks/scanning_campaigns.py")


def test_two_passes_with_conscan_point_a_third_on_the_model_alone(script: Any, tmp_path: Path) -> None:
    described, file = StationSetup("leo_3m7"), tmp_path / "beacon.tle"
    *passes, (elements, window) = script.planned(described.station.site, SPAN_S)
    log = script.log_of(described)
    for beacon, one in passes:
        log.begin_pass()
        setup = script.setup_of("leo_3m7", beacon, one, file, log=log)
        simulate_pass(setup, one, one.aos_t_s - script.LEAD_S, "conscan")
        assert len(log) >= 15, log.reasons()
    model: BiasModel = log.fit(described.model, pass_priors=PassPriors.of_orbit(script.ORBIT_M)).model
    missed = script.missed_beamwidths(script.setup_of("leo_3m7", elements, window, file, model), window)
    print(f"{len(log)} observations, missed by {100.0 * missed:.1f} % of a beamwidth")
    assert math.isfinite(missed)
    assert missed < script.ALLOWED_BEAMWIDTHS
