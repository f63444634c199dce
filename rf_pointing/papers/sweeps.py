"""Run a task over many cases in this process, on others or on other machines.

`concurrent.futures.ProcessPoolExecutor(2)`, or Dask's `Client("tcp://host:8786").get_executor()`
(extra `sweep`). Task, cases and results must be picklable; each case carries its own seed, so that
the place changes no number.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import TypeVar

Case = TypeVar("Case")
Result = TypeVar("Result")


def sweep(task: Callable[[Case], Result], cases: Sequence[Case], executor: Executor | None = None) -> list[Result]:
    """Return `task` of every case in order, here or on `executor`; the first failure is raised."""
    return list(map(task, cases) if executor is None else executor.map(task, cases))
