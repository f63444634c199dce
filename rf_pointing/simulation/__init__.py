"""The whole station in one process, without ROS."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.simulation.pass_simulation import PassLog, StationSetup, merged, simulate_pass

__getattr__ = lazily(__name__, __file__)
