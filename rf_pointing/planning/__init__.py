"""What the machine may do: limits of travel, the pass certificate with its branches, the gate of every motion."""

from rf_pointing.planning.certificate import Branch, Certificate, MachineParams, certify, plunged, unplunged
from rf_pointing.planning.certificate_text import certificate_lines, certificate_values
from rf_pointing.planning.crossing import AxisMotionLimits, Crossing, cross
from rf_pointing.planning.limits import AxisLimits, choose_turns, refusal
from rf_pointing.planning.mask import HorizonMask
from rf_pointing.planning.profile import PassProfile

__all__ = [
    "AxisLimits",
    "AxisMotionLimits",
    "Branch",
    "Certificate",
    "Crossing",
    "HorizonMask",
    "MachineParams",
    "PassProfile",
    "certificate_lines",
    "certificate_values",
    "certify",
    "choose_turns",
    "cross",
    "plunged",
    "refusal",
    "unplunged",
]
