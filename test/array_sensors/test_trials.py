"""A few runs of each scene of `benchmarks/array_trials.py`: no valid epoch beyond 5 sigma."""

import importlib.util
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.stats import chi2

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "array_trials.py"


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("array_trials", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # The dataclasses of the script look their module up.
    sys.modules["array_trials"] = module
    spec.loader.exec_module(module)
    return module


TRIALS = load()
SCENES: list[tuple[Callable[[int], object], int, bool]] = [
    *((partial(TRIALS.tripulse_run, case), 4, True) for case in TRIALS.TRIPULSE_CASES.values()),
    *((partial(TRIALS.docking_run, case), 3, True) for case in TRIALS.DOCKING_CASES.values()),
    (partial(TRIALS.doa_run, TRIALS.DOA_CASES["one channel"]), 1, False),
    (partial(TRIALS.doa_run, TRIALS.DOA_CASES["1.5 km apart"]), 1, False),
]
NAMES = [
    *(f"tripulse {name}" for name in TRIALS.TRIPULSE_CASES),
    *(f"interferometer {name}" for name in TRIALS.DOCKING_CASES),
    "doa one channel",
    "doa 1.5 km apart",
]


@pytest.mark.parametrize(("run", "runs", "steady"), SCENES, ids=NAMES)
def test_what_is_valid_is_within_its_covariance(run: Callable[[int], object], runs: int, steady: bool) -> None:
    found = [run(seed) for seed in range(1, runs + 1)]
    assert sum(each.far for each in found) == 0
    last = [each.nees[np.flatnonzero(each.valid)[-1]] for each in found if each.valid.any()]
    if steady and last:
        axes = found[0].error.shape[1]
        assert np.mean(last) < chi2.ppf(0.9999, axes * len(last)) / len(last)
