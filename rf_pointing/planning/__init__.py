"""Rules of the machine's motion: limits, the certificate of a pass, the safety gate, watches."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.planning.certificate import Branch, Certificate, SensorCost, certify
    from rf_pointing.planning.certificate_text import certificate_lines, certificate_values
    from rf_pointing.planning.gate import Decision, Gate, GateParams, motion_between
    from rf_pointing.planning.horizon import HorizonMask
    from rf_pointing.planning.interlocks import Authority, FaultLatch, WrapCount
    from rf_pointing.planning.limits import AxisLimits, AxisRates, MachineParams, choose_turns
    from rf_pointing.planning.over_the_top import plunged, unplunged
    from rf_pointing.planning.position_watch import PositionLimits, PositionWatch
    from rf_pointing.planning.profile import PassProfile
    from rf_pointing.planning.schedule import Candidate, reasons_against, turns_within
    from rf_pointing.planning.slew import CornerPath
    from rf_pointing.planning.watches import (
        AxisWatch,
        AxisWatchParams,
        DriveWatch,
        DriveWatchParams,
        WindWatch,
        WindWatchParams,
    )

__getattr__ = lazily(__name__, __file__)
