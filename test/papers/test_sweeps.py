"""A sweep gives the same results in order wherever it runs: here, on threads, on processes, on a Dask cluster."""

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.papers.sweeps import processes, sweep

CASES = list(range(8))


# A new process cannot import a test.
task = partial(random_stream, name="sweep")


def drawn(results: list[np.random.Generator]) -> list[float]:
    return [float(result.standard_normal()) for result in results]


def failing(case: int) -> int:
    if case == 3:
        raise ValueError(f"case={case} must not be 3")
    return case


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, processes])
def test_executors_of_the_standard_library_change_no_number(pool: Callable[[int], Executor]) -> None:
    with pool(2) as executor:
        assert drawn(sweep(task, CASES, executor)) == drawn(sweep(task, CASES))


def test_first_failure_is_raised() -> None:
    with ThreadPoolExecutor(2) as executor, pytest.raises(ValueError, match="case=3"):
        sweep(failing, CASES, executor)


def test_a_dask_cluster_changes_no_number() -> None:
    distributed = pytest.importorskip("distributed", reason="the extra `sweep` is not installed")
    with distributed.Client(processes=False, n_workers=1, threads_per_worker=2, dashboard_address=None) as client:
        assert drawn(sweep(task, CASES, client.get_executor())) == drawn(sweep(task, CASES))
