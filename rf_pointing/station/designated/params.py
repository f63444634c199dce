"""Parameters of reported targets; every node that checks a station's file loads them."""

import math
from dataclasses import dataclass

from rf_pointing.core import Params, parameter
from rf_pointing.designate.motion import CLASSES
from rf_pointing.designate.report import ReportNoise


@dataclass(frozen=True, kw_only=True)
class DesignateParams(Params):
    """Who reports, and what kind of target they report."""

    source: str = parameter(
        "", "addresses that reports come from, separated by blanks: adsb:HOST:PORT, sonde:ADDRESS:PORT, "
        "mavlink:ADDRESS:PORT, each with /NAME for one target only; or table:FILE; empty: topics",
    )  # fmt: skip
    kind: str = parameter("aircraft", "balloon, aircraft, rocket or ship", choices=tuple(CLASSES))
    target: str = parameter(
        "", "name of the target in the reports that is selected at the start; empty: by service"
    )
    fused: bool = parameter(False, "all reports are of one target, whatever they name it")
    latency_s: float = parameter(0.0, "time from a place to the arrival of its report", 0.0, 60.0)
    noise: ReportNoise = parameter(ReportNoise(), "errors of the reports")
    period_s: float = parameter(0.1, "time between two targets", 0.02, 10.0)
    lead_s: float = parameter(2.0, "how far ahead of its time a target is published", 0.0, 60.0)
    mask_rad: float = parameter(
        math.radians(5.0), "elevation at which a target rises and sets", 0.0, 1.5
    )
