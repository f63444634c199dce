"""The certificate's expected loss is within 0.1 dB of the flown one: three bands, three sensors, once near the zenith.

`benchmarks/predicted_loss.py` flies more cases and prints both.
"""

import importlib.util
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.core.pass_outcome import PassOutcome
from rf_pointing.simulation import simulate_pass

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "predicted_loss.py"
NEAR_DB = 0.1


@pytest.fixture(scope="module")
def script() -> Any:
    spec = importlib.util.spec_from_file_location("predicted_loss", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["S,conscan,40", "S,steptrack,40", "Ka,monopulse,40", "X,monopulse,88"])
def test_the_flown_loss_is_the_predicted_one(script: Any, name: str) -> None:
    setup, window, sensor, width_rad = script.case(name)
    log = simulate_pass(setup, window, math.floor(window.aos_t_s) - script.LEAD_S, sensor)
    inside = (np.array(log.t_s) >= window.aos_t_s) & (np.array(log.t_s) <= window.los_t_s)
    flown = PassOutcome.of(np.hypot(*log.errors_rad().T)[inside], width_rad, script.CLUSTER_S)
    assert log.certificate is not None
    chosen = log.certificate.chosen
    assert chosen is not None
    print(f"{name}: predicted {chosen.mean_loss_db:.3f} dB, flown {flown.mean_loss_db:.3f} dB")
    assert abs(flown.mean_loss_db - chosen.mean_loss_db) <= NEAR_DB
