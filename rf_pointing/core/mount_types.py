"""The mounts that there are: names of their axes, and what each needs (`core/kinematics.py`)."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rf_pointing.core.signals import AXES

AZIMUTH_ELEVATION = "azimuth_elevation"
LOWER_AXES = ("east_west", "north_south")
HOURS = ("hour_angle", "declination")


class MountType(NamedTuple):
    """Names of the lower and upper axis, the keys that the mount needs, and `further` ones.

    A `polar` one needs its latitude.  A lower axis turns against azimuth where `reversed_by` its
    direction; `leans`: how it is off, about the mount's right and ahead (`calibration/terms.py`).
    """

    axes: tuple[str, str]
    keys: tuple[str, ...] = ()
    further: tuple[str, ...] = ()
    polar: bool = False
    reversed_by: str = ""
    leans: tuple[str, str] = ("mislevel_east", "mislevel_north")


MOUNTS: Mapping[str, MountType] = {
    AZIMUTH_ELEVATION: MountType(AXES),
    "x_y": MountType(
        ("x", "y"), ("lower_axis",), reversed_by=LOWER_AXES[1], leans=("axis_level", "axis_heading")
    ),
    # Hour angle positive to the west, declination to the north.
    "ha_dec": MountType(HOURS, polar=True, leans=("polar_altitude", "polar_azimuth")),
    "azimuth_elevation_tilt": MountType(AXES, ("tilt_deg",), ("train_deg", "train_rate_deg_s")),
}
"""Every mount by the word of a station description."""


def axes_among(joints: Sequence[str]) -> tuple[str, str]:
    """Return the axes of the mount whose joints are among these, else azimuth and elevation."""
    return next((each.axes for each in MOUNTS.values() if set(each.axes) <= set(joints)), AXES)
