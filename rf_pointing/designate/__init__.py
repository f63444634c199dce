"""Targets without an orbit: reports of where something is, from receivers, radars and tables."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.designate.decoders import DECODERS
    from rf_pointing.designate.motion import CLASSES, MotionFilter, ReportedMotion
    from rf_pointing.designate.path import DesignatedPath
    from rf_pointing.designate.report import Report, ReportNoise
    from rf_pointing.designate.table import read_table

__getattr__ = lazily(__name__, __file__)
