"""What a satellite with a direction-finding array says of itself: snapshots of a channel, and known torques."""

from dataclasses import dataclass

from rf_pointing.array_sensors.arrays.array_source import SnapshotBlock
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque

__all__ = ["ChannelBlock", "HeldTorque"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelBlock:
    """Snapshots of one channel, and the stations that are known to send in it."""

    transmitters: tuple[str, ...]
    block: SnapshotBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldTorque:
    """Torques that the satellite knows, from `t_s` on."""

    t_s: float
    known: KnownTorque
