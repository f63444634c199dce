"""The terms of the bias model (SATCAL eqs. 1-2) and the registry of named extensions.

Each term adds coefficient * azimuth(...) to the azimuth and coefficient * elevation(...) to the elevation:

    Az_o = Az_t + x1 + x2 tan El + x3 sec El + x4 sin Az + x5 cos Az + x6 Az' + x7 Az'' + (x8 sin Az - x9 cos Az) tan El
    El_o = El_t + x8 cos Az + x9 sin Az + x10 + x11 cos El + x12 sin El + x13 El' + x14 El''

The four terms that tilt or skew an axis (x2, x3, x8, x9) are rotations; the printed form is their first order.
"""

from collections.abc import Iterable

from rf_pointing.calibration.extension_terms import EXTENSION_TERMS
from rf_pointing.calibration.term import ALL_AZIMUTHS, LOW_AND_HIGH, RISE_AND_SET, Term

__all__ = ["EXTENSION_TERMS", "TERMS", "TERM_NAMES", "Term", "all_terms", "terms_by_name"]

TERMS: tuple[Term, ...] = (
    Term(
        name="azimuth_offset",
        number=1,
        unit="rad",
        kind="additive",
        formula="dAz = x1",
        separated_by=LOW_AND_HIGH,
        azimuth=lambda a: a.one,
    ),
    Term(
        name="non_orthogonality",
        number=2,
        unit="rad",
        kind="rotation",
        formula="dAz = x2 tan El",
        separated_by=LOW_AND_HIGH,
        azimuth=lambda a: a.tan_elevation,
    ),
    Term(
        name="collimation",
        number=3,
        unit="rad",
        kind="rotation",
        formula="dAz = x3 sec El",
        separated_by=LOW_AND_HIGH,
        azimuth=lambda a: a.sec_elevation,
    ),
    Term(
        name="azimuth_encoder_sine",
        number=4,
        unit="rad",
        kind="additive",
        formula="dAz = x4 sin Az",
        separated_by=ALL_AZIMUTHS,
        azimuth=lambda a: a.sin_azimuth(1),
    ),
    Term(
        name="azimuth_encoder_cosine",
        number=5,
        unit="rad",
        kind="additive",
        formula="dAz = x5 cos Az",
        separated_by=ALL_AZIMUTHS,
        azimuth=lambda a: a.cos_azimuth(1),
    ),
    Term(
        name="azimuth_velocity_lag",
        number=6,
        unit="s",
        kind="lag",
        formula="dAz = x6 dAz/dt",
        separated_by=RISE_AND_SET,
        azimuth=lambda a: a.azimuth_rate,
    ),
    Term(
        name="azimuth_acceleration_lag",
        number=7,
        unit="s^2",
        kind="lag",
        formula="dAz = x7 d2Az/dt2",
        separated_by=RISE_AND_SET,
        azimuth=lambda a: a.azimuth_acceleration,
    ),
    Term(
        name="mislevel_east",
        number=8,
        unit="rad",
        kind="rotation",
        formula="dAz = x8 sin Az tan El, dEl = x8 cos Az",
        separated_by=ALL_AZIMUTHS,
        azimuth=lambda a: a.sin_azimuth(1) * a.tan_elevation,
        elevation=lambda a: a.cos_azimuth(1),
    ),
    Term(
        name="mislevel_north",
        number=9,
        unit="rad",
        kind="rotation",
        formula="dAz = -x9 cos Az tan El, dEl = x9 sin Az",
        separated_by=ALL_AZIMUTHS,
        azimuth=lambda a: -a.cos_azimuth(1) * a.tan_elevation,
        elevation=lambda a: a.sin_azimuth(1),
    ),
    Term(
        name="elevation_offset",
        number=10,
        unit="rad",
        kind="additive",
        formula="dEl = x10",
        separated_by=LOW_AND_HIGH,
        elevation=lambda a: a.one,
    ),
    Term(
        name="droop",
        number=11,
        unit="rad",
        kind="additive",
        formula="dEl = x11 cos El",
        separated_by=LOW_AND_HIGH,
        elevation=lambda a: a.cos_elevation(1),
    ),
    Term(
        name="elevation_encoder_sine",
        number=12,
        unit="rad",
        kind="additive",
        formula="dEl = x12 sin El",
        separated_by=LOW_AND_HIGH,
        elevation=lambda a: a.sin_elevation(1),
    ),
    Term(
        name="elevation_velocity_lag",
        number=13,
        unit="s",
        kind="lag",
        formula="dEl = x13 dEl/dt",
        separated_by=RISE_AND_SET,
        elevation=lambda a: a.elevation_rate,
    ),
    Term(
        name="elevation_acceleration_lag",
        number=14,
        unit="s^2",
        kind="lag",
        formula="dEl = x14 d2El/dt2",
        separated_by=RISE_AND_SET,
        elevation=lambda a: a.elevation_acceleration,
    ),
)
"""The 14 terms of SATCAL eqs. (1)-(2), in the paper's order."""

TERM_NAMES: tuple[str, ...] = tuple(term.name for term in TERMS)


_KNOWN = {term.name: term for term in TERMS + EXTENSION_TERMS}


def all_terms() -> dict[str, Term]:
    """Return every known term by name."""
    return dict(_KNOWN)


def terms_by_name(names: Iterable[str]) -> tuple[Term, ...]:
    """Return the terms of `names` in that order; an unknown or repeated name is an error."""
    chosen = list(names)
    unknown = [name for name in chosen if name not in _KNOWN]
    if unknown:
        raise ValueError(f"the bias model has no term {', '.join(unknown)}; it has {', '.join(_KNOWN)}")
    if len(set(chosen)) < len(chosen):
        repeated = sorted({name for name in chosen if chosen.count(name) > 1})
        raise ValueError(f"term {', '.join(repeated)} is given more than once")
    return tuple(_KNOWN[name] for name in chosen)
