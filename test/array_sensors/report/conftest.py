"""The makers of messages of test/report serve here too."""

from test.report.conftest import maker, types

__all__ = ["maker", "types"]
