"""Ground-station antenna pointing: `import rf_pointing as rp`.

A numeric core without ROS, and in `nodes` the ROS 2 graph around it.  The names below are the
public surface; each is loaded when it is first used.  docs/api.md shows them at work.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rf_pointing.api.station import Station
    from rf_pointing.api.target import Target, catalogue, elements

__version__ = "0.1.0"
__all__ = ["Station", "Target", "catalogue", "elements"]
_HOMES = {"Station": "station", "Target": "target", "catalogue": "target", "elements": "target"}

if not TYPE_CHECKING:
    # A type checker reads the imports above, and refuses a wrong name.
    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module 'rf_pointing' has no attribute {name!r}")
        return getattr(importlib.import_module(f"rf_pointing.api.{_HOMES[name]}"), name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
