"""Distribution of tests over workers: a file stays together, and a test that ends its worker costs itself.

xdist's own `loadfile` gives a dead worker's files to one that has not collected yet, which ends the run with a
KeyError, and runs the deadly test again and again.
"""

from typing import Any

import pytest
from xdist.scheduler.loadfile import LoadFileScheduling


class ByFile(LoadFileScheduling):
    """Files in the order of the collection; what a dead worker has left goes to the others."""

    def remove_node(self, node: Any) -> str | None:
        """Return the test that has ended the worker, None for one that had nothing left to do."""
        left = {
            file: tests
            for file, unit in self.assigned_work.pop(node).items()
            if (tests := {test: False for test, done in unit.items() if not done})
        }
        if not left:
            return None
        file, tests = next(iter(left.items()))
        deadly = next(iter(tests))
        del tests[deadly]
        if not tests:
            del left[file]
        self.workqueue.update(left)
        if self.workqueue:
            self.schedule()
        return deadly

    def _assign_work_unit(self, node: Any) -> None:
        # One that has not collected yet gets its work when it has.
        if node in self.registered_collections:
            super()._assign_work_unit(node)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByFile:
    """Let xdist distribute by file."""
    return ByFile(config, log)
