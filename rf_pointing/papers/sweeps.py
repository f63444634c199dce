"""Run a task over many cases in this process, on others or on other machines.

`processes(2)`, or Dask's `Client("tcp://host:8786").get_executor()` (extra `sweep`). Task, cases
and results must be picklable; each case carries its own seed, so that the place changes no number.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

Case = TypeVar("Case")
Result = TypeVar("Result")


def sweep(
    task: Callable[[Case], Result], cases: Sequence[Case], executor: Executor | None = None
) -> list[Result]:
    """Return `task` of every case in order, here or on `executor`; the first failure is raised."""
    return list(map(task, cases) if executor is None else executor.map(task, cases))


def processes(count: int) -> ProcessPoolExecutor:
    """Return a pool of `count` new processes; a script that uses it must guard its `__main__`."""
    # Not forked: a lock that another thread holds at the fork is never released in the copy.
    return ProcessPoolExecutor(count, mp_context=get_context("spawn"))
