"""Drives that take rates: their position loop is closed here, as late as the device is."""

from collections.abc import Mapping
from typing import Any

from rf_pointing.core.parameters import flat
from rf_pointing.drives.params import DriveParams
from rf_pointing.drives.registry import takes_positions


def takes_rates(drive: Mapping[str, Any]) -> bool:
    """Return whether a drive section names a device whose position loop this station closes."""
    kind = str(drive.get("type", "simulated"))
    return kind != "simulated" and not takes_positions(kind) and drive.get("model") != "position"


def rate_latency_s(drive: Mapping[str, Any]) -> float:
    """Return the stated time from a rate to the motion; 0 for drives that do not take rates."""
    usual = DriveParams().rotator.latency_s
    return float(flat(drive).get("rotator.latency_s", usual)) if takes_rates(drive) else 0.0
