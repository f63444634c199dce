"""One node of a name per namespace and ROS domain on a machine: the second one is refused, not left to fight.

The lock is the kernel's, so it goes with the process however that ends.
"""

import fcntl
import os
import tempfile
from pathlib import Path

__all__ = ["InstanceLock"]


class InstanceLock:
    """Holds the name `full_name` (for example /gs1/antenna_servo) in the present ROS domain."""

    def __init__(self, full_name: str) -> None:
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        folder = Path(tempfile.gettempdir()) / f"rf_pointing-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        self.path = folder / f"domain{domain}{full_name.replace('/', '.')}.lock"
        self._file = self.path.open("a+")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._file.seek(0)
            holder = self._file.read().strip() or "unknown"
            self._file.close()
            raise RuntimeError(f"{full_name} already runs in ROS domain {domain} (process {holder})") from error
        self._file.truncate(0)
        self._file.write(str(os.getpid()))
        self._file.flush()

    def release(self) -> None:
        """Give the name back; the file stays, since removing it would let two holders lock two files."""
        self._file.close()
