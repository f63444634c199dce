"""Fixtures of every test: one seeded generator, limits in wall time, a ROS domain of the session's own."""

import fcntl
import importlib
import importlib.util
import os
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest

# Without xdist its hook would be unknown.
if importlib.util.find_spec("xdist"):
    from test.by_file import pytest_xdist_make_scheduler  # noqa: F401

DOMAINS = 100
"""ROS domains 1 to 100 keep their ports below the range that the kernel hands out."""
LOOPBACK = Path(__file__).parents[1] / "config" / "fastdds_loopback.xml"


# How long an example takes says how busy the machine is.
hypothesis.settings.register_profile("busy", deadline=None)
hypothesis.settings.load_profile("busy")

_APPROX = pytest.approx


def approx(expected: Any, rel: float | None = None, abs: float | None = None, nan_ok: bool = False) -> Any:
    """Compare as pytest's own, whose absolute tolerance of 1e-12 accepts anything for rad^2 or watts.

    Where none is given, it is no more than the relative tolerance of the smallest expected number.
    """
    if abs is None:
        try:
            numbers = np.abs(np.array(expected, dtype=np.complex128).ravel())
        except (TypeError, ValueError):
            # A dictionary, or what approx itself refuses.
            return _APPROX(expected, rel=rel, abs=abs, nan_ok=nan_ok)
        some = numbers[(numbers > 0.0) & np.isfinite(numbers)]
        if some.size and (own := (1e-6 if rel is None else rel) * float(some.min())) < 1e-12:
            abs = own
    return _APPROX(expected, rel=rel, abs=abs, nan_ok=nan_ok)


pytest.approx = approx


def pytest_report_header() -> str:
    """Say which tests are left out where there is no ROS."""
    found = importlib.util.find_spec("rclpy") is not None
    return f"ROS 2: {'found' if found else 'not found, tests of nodes, commands and graphs are left out'}"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave live graphs out of `colcon test`: packages are tested in parallel there, and graphs need the machine."""
    # colcon names the package in the results; nobody else does.
    if config.getoption("junitprefix", "") == "rf_pointing":
        live = [item for item in items if item.get_closest_marker("graph")]
        config.hook.pytest_deselected(items=live)
        items[:] = [item for item in items if item not in set(live)]


@pytest.fixture
def random() -> np.random.Generator:
    """Return the seeded generator of a test; every test starts it afresh."""
    return np.random.Generator(np.random.PCG64(20060627))


IDLE_LOOPS, IDLE_S = 320_000, 0.008
"""Loops of `slowness`'s work, and their wall time on an idle core of the machine of the limits."""
TOO_SLOW = 8.0
"""Slowness at which a limit in wall time says nothing about the code any more."""


def slowness() -> float:
    """Return how many times slower than an idle one this machine is at the moment, at least 1."""
    # Split by sleeps: who wakes has to wait for the others that want the core, as a test does.
    began_s = time.perf_counter()
    for _ in range(10):
        sum(number * number for number in range(IDLE_LOOPS))
        time.sleep(0.001)
    return max(1.0, (time.perf_counter() - began_s) / (10.0 * (IDLE_S + 0.001)))


def within(taken_s: float, limit_s: float) -> bool:
    """Return whether a wall time keeps a limit, which grows with the slowness of the machine.

    The limit is that of an idle machine.  Where it is missed and the machine is too slow for any
    limit, the test is skipped.
    """
    if taken_s < limit_s:
        return True
    if (slower := slowness()) > TOO_SLOW:
        pytest.skip(f"this machine is too slow for this test: {slower:.0f} times slower than an idle one at the moment, "
            f"and {limit_s:g} s of wall time became {taken_s:.1f} s")  # fmt: skip
    return taken_s < limit_s * slower


def import_type_support() -> None:
    """Import what rclpy imports on its first message; a parser below it warns of its own old imports."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        importlib.import_module("rosidl_generator_py")


@pytest.fixture(scope="session")
def ros_domain() -> Iterator[int]:
    """Yield a ROS domain that is this session's own, and set it for every process the tests start.

    The first guess comes from the process id; a lock that goes with the process settles collisions.
    """
    import_type_support()
    folder = Path(tempfile.gettempdir()) / f"rf_pointing-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    for guess in range(DOMAINS):
        domain = 1 + (os.getpid() + guess) % DOMAINS
        with (folder / f"test-domain{domain}.lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            with pytest.MonkeyPatch.context() as patch:
                patch.setenv("ROS_DOMAIN_ID", str(domain))
                patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT")
                patch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(LOOPBACK))
                yield domain
            return
    pytest.fail(f"all {DOMAINS} ROS domains are taken by other test sessions")


@pytest.fixture
def ros_context(ros_domain: int) -> Iterator[Any]:
    """Yield a private context."""
    import rclpy
    from rclpy.context import Context

    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    yield context
    context.try_shutdown()


@pytest.fixture
def make_node(ros_context: Any) -> Iterator[Callable[..., Any]]:
    """Yield a maker of plain nodes; keyword `given` holds parameter values as a file would give them."""
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    made: list[Any] = []

    def make(name: str = "subject", given: dict[str, Any] | None = None) -> Any:
        overrides = [Parameter(key, value=value) for key, value in (given or {}).items()]
        node = Node(name, context=ros_context, namespace="/test", parameter_overrides=overrides)
        made.append(node)
        return node

    yield make
    for node in made:
        node.destroy_node()


@pytest.fixture
def default_context(ros_domain: int) -> Iterator[None]:
    """Initialise the default context, which managed nodes use."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
    yield
    rclpy.try_shutdown()


@pytest.fixture
def make_bench(ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Yield a maker of nodes on a bench (`test/nodes/bench.py`): one after the other, or `beside` the others."""
    from test.nodes.bench import Bench

    made: list[Any] = []

    def make(node_type: Any, *, beside: bool = False, **given: Any) -> Any:
        while made and not beside:
            made.pop().close()
        made.append(Bench(node_type, monkeypatch, ros_domain, **given))
        return made[-1]

    yield make
    for each in made:
        each.close()
