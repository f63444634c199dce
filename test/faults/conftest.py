"""Live nodes for the fault tests: the same fixtures as the graph tests."""

from test.graph.conftest import live, private_domain

__all__ = ["live", "private_domain"]
