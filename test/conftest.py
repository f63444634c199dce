"""What every test may ask for: one seeded generator, and a ROS domain that no other session on this machine uses."""

import fcntl
import importlib
import importlib.util
import os
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

DOMAINS = 100
"""ROS domains 1 to 100 keep their ports below the range that the kernel hands out."""
LOOPBACK = Path(__file__).parents[1] / "config" / "fastdds_loopback.xml"


def pytest_report_header() -> str:
    """Say which tests are left out where there is no ROS."""
    found = importlib.util.find_spec("rclpy") is not None
    return f"ROS 2: {'found' if found else 'not found, test/nodes and test/graph are left out'}"


@pytest.fixture
def random() -> np.random.Generator:
    """Return the seeded generator of a test; every test starts it afresh."""
    return np.random.Generator(np.random.PCG64(20060627))


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
