"""One node of a name per namespace and ROS domain on a machine: the second one is refused, not left to fight.

The lock is the kernel's, so it goes with the process however that ends.
"""

import fcntl
import os
import tempfile
from pathlib import Path

__all__ = ["InstanceLock", "last_holder"]


class InstanceLock:
    """Holds the name `full_name` (for example /gs1/antenna_servo) in the present ROS domain."""

    def __init__(self, full_name: str) -> None:
        self.path = _path(full_name)
        self.path.parent.mkdir(mode=0o700, exist_ok=True)
        self._file = self.path.open("a+")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._file.seek(0)
            holder = self._file.read().strip() or "unknown"
            self._file.close()
            raise RuntimeError(f"{full_name} already runs in ROS domain {_domain()} (process {holder})") from error
        self._file.truncate(0)
        self._file.write(str(os.getpid()))
        self._file.flush()

    def release(self) -> None:
        """Give the name back; the file stays, since removing it would let two holders lock two files."""
        self._file.close()


def last_holder(full_name: str) -> int | None:
    """Return the process that took the name last in the present ROS domain, whether it still lives or not."""
    try:
        return int(_path(full_name).read_text())
    except (FileNotFoundError, ValueError):  # never taken, or being taken at this moment
        return None


def _domain() -> str:
    return os.environ.get("ROS_DOMAIN_ID", "0")


def _path(full_name: str) -> Path:
    folder = Path(tempfile.gettempdir()) / f"rf_pointing-{os.getuid()}"
    return folder / f"domain{_domain()}{full_name.replace('/', '.')}.lock"
