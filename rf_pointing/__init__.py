"""Ground-station antenna pointing: `import rf_pointing as rp`; docs/api.md shows it at work.

A numeric core without ROS, and around it the ROS 2 graph in `nodes`.  Names load when first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rf_pointing.api.calibration import Fit, fit
    from rf_pointing.api.clock import ClockCheck, check_clock
    from rf_pointing.api.ensemble import Ensemble, ensemble
    from rf_pointing.api.ledger import budget, ledger
    from rf_pointing.api.network import NetworkPlan, plan_network
    from rf_pointing.api.orbit_study import OrbitCovariance, orbit_covariance
    from rf_pointing.api.orbits import DeterminedOrbit, orbit_from_passes
    from rf_pointing.api.passes import Look, PassCertificate, StationPass
    from rf_pointing.api.plan import Plan
    from rf_pointing.api.recording import Recording
    from rf_pointing.api.replay import Replay, replay
    from rf_pointing.api.simulated import SimulatedPass
    from rf_pointing.api.station import Station
    from rf_pointing.api.target import Target, catalogue, elements
    from rf_pointing.api.tuning import Tuning, tune
    from rf_pointing.calibration.bias_model import BiasModel
    from rf_pointing.calibration.model_file import ModelVersion, read_model
    from rf_pointing.calibration.observations import Observations
    from rf_pointing.report.error_ledger import Ledger

__version__ = "0.1.0"
_HOMES = {
    "BiasModel": "calibration.bias_model", "ClockCheck": "api.clock",
    "DeterminedOrbit": "api.orbits", "Ensemble": "api.ensemble", "Fit": "api.calibration",
    "Ledger": "report.error_ledger", "Look": "api.passes", "ModelVersion": "calibration.model_file",
    "NetworkPlan": "api.network", "Observations": "calibration.observations",
    "OrbitCovariance": "api.orbit_study", "PassCertificate": "api.passes", "Plan": "api.plan",
    "Recording": "api.recording", "Replay": "api.replay", "SimulatedPass": "api.simulated",
    "Station": "api.station", "StationPass": "api.passes", "Target": "api.target",
    "Tuning": "api.tuning", "budget": "api.ledger", "catalogue": "api.target",
    "check_clock": "api.clock", "elements": "api.target", "ensemble": "api.ensemble",
    "fit": "api.calibration", "ledger": "api.ledger", "orbit_covariance": "api.orbit_study",
    "orbit_from_passes": "api.orbits", "plan_network": "api.network",
    "read_model": "calibration.model_file", "replay": "api.replay", "tune": "api.tuning",
}  # fmt: skip
"""Every public name, and the module that it is loaded from."""
__all__ = [
    "BiasModel", "ClockCheck", "DeterminedOrbit", "Ensemble", "Fit", "Ledger", "Look",
    "ModelVersion", "NetworkPlan", "Observations", "OrbitCovariance", "PassCertificate", "Plan",
    "Recording", "Replay", "SimulatedPass", "Station", "StationPass", "Target", "Tuning", "budget",
    "catalogue", "check_clock", "elements", "ensemble", "fit", "ledger", "orbit_covariance",
    "orbit_from_passes", "plan_network", "read_model", "replay", "tune",
]  # fmt: skip

if not TYPE_CHECKING:
    # A type checker reads the imports above, and refuses a wrong name.
    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module 'rf_pointing' has no attribute {name!r}")
        return getattr(importlib.import_module(f"rf_pointing.{_HOMES[name]}"), name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *_HOMES})
