"""What the machine may do: limits of travel, the pass certificate with its branches, the gate of every motion."""

from rf_pointing.planning.authority import Authority
from rf_pointing.planning.axis_watch import AxisWatch, AxisWatchParams
from rf_pointing.planning.certificate import Branch, Certificate, certify
from rf_pointing.planning.certificate_text import certificate_lines, certificate_values
from rf_pointing.planning.corner_path import CornerPath
from rf_pointing.planning.crossing import AxisMotionLimits, Crossing, cross
from rf_pointing.planning.drive_watch import DriveWatch, DriveWatchParams
from rf_pointing.planning.fault_latch import FaultLatch, LatchedFault
from rf_pointing.planning.gate import MOTIONS, Decision, Gate, GateParams, motion_between
from rf_pointing.planning.limits import AxisLimits, choose_turns, refusal
from rf_pointing.planning.machine import MachineParams
from rf_pointing.planning.mask import HorizonMask
from rf_pointing.planning.plunge import plunged, unplunged
from rf_pointing.planning.profile import PassProfile
from rf_pointing.planning.slew import AxisRates
from rf_pointing.planning.wind_watch import WindWatch, WindWatchParams
from rf_pointing.planning.wrap_count import WrapCount

__all__ = [
    "MOTIONS",
    "Authority",
    "AxisLimits",
    "AxisMotionLimits",
    "AxisRates",
    "AxisWatch",
    "AxisWatchParams",
    "Branch",
    "Certificate",
    "CornerPath",
    "Crossing",
    "Decision",
    "DriveWatch",
    "DriveWatchParams",
    "FaultLatch",
    "Gate",
    "GateParams",
    "HorizonMask",
    "LatchedFault",
    "MachineParams",
    "PassProfile",
    "WindWatch",
    "WindWatchParams",
    "WrapCount",
    "certificate_lines",
    "certificate_values",
    "certify",
    "choose_turns",
    "cross",
    "motion_between",
    "plunged",
    "refusal",
    "unplunged",
]
