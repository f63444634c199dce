"""Keeps the elements of a running node fresh.

An address is requested by `fetch_elements`, a process of its own: no server, however slow, holds up
a node.  A file or a folder may be replaced by anybody at any time.  The node learns of both by
`changed` and decides itself when the new elements come into force.
"""

import subprocess
import sys
import time

from rf_pointing.ephemeris.element_files import is_address, version_of

FETCH = [sys.executable, "-c", "from rf_pointing.commands.fetch_elements import main; main()"]
FIRST_S = 90.0
"""How long a node waits for elements that it has never had."""
EVERY_S = 600.0
"""How often the command is started; the source's rule decides whether it sends a request."""


class ElementUpdates:
    """Watches the elements at one location; of an address, starts the command that fetches them."""

    def __init__(self, location: str) -> None:
        self._location = location
        self._process: subprocess.Popen[str] | None = None
        self._started_s = -EVERY_S
        self._version = version_of(location)
        self.problem = ""
        """Why the elements could not be renewed, empty when they could."""

    def require(self) -> None:
        """Fetch elements that are not there at all; ValueError with the reason when none come."""
        if not is_address(self._location) or self._version:
            return
        self._started_s = time.monotonic()
        command = [*FETCH, self._location]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=FIRST_S, check=False)
        except subprocess.TimeoutExpired:
            raise ValueError(f"elements={self._location!r} were not fetched within {FIRST_S:g} s") from None
        self._version = version_of(self._location)
        if not self._version:
            lines = done.stderr.strip().splitlines() or [f"fetch_elements ended with exit code {done.returncode}"]
            raise ValueError(f"elements={self._location!r}: {lines[-1].removeprefix('fetch_elements: ')}")

    def changed(self) -> bool:
        """Return whether the files differ from those of the last `accept`."""
        if is_address(self._location):
            self._run()
        found = version_of(self._location)
        return bool(found) and found != self._version

    def accept(self) -> None:
        """Take the present files as those in force."""
        self._version = version_of(self._location)

    def end(self) -> None:
        """End the command, if it runs."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def _run(self) -> None:
        if self._process is None:
            # The clock of the node may be simulated; servers live in real time.
            if time.monotonic() - self._started_s >= EVERY_S:
                self._started_s = time.monotonic()
                self._process = subprocess.Popen(
                    [*FETCH, self._location], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
                )
        elif self._process.poll() is not None:
            lines = self._process.communicate()[1].strip().splitlines()
            self.problem = lines[-1].removeprefix("fetch_elements: ") if self._process.returncode and lines else ""
            self._process = None
