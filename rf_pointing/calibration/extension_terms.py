"""Named terms that may be added to the 14 of SATCAL: harmonics, flexure beyond the zenith, temperature."""

from rf_pointing.calibration.term import ALL_AZIMUTHS, LOW_AND_HIGH, Term

__all__ = ["EXTENSION_TERMS"]

EXTENSION_TERMS: tuple[Term, ...] = (
    Term(
        name="azimuth_second_sine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dAz = c sin 2Az",
        separated_by=ALL_AZIMUTHS,
        azimuth=lambda a: a.sin_azimuth(2),
    ),
    Term(
        name="azimuth_second_cosine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dAz = c cos 2Az",
        separated_by=ALL_AZIMUTHS,
        azimuth=lambda a: a.cos_azimuth(2),
    ),
    Term(
        name="elevation_azimuth_second_sine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c sin 2Az",
        separated_by=ALL_AZIMUTHS,
        elevation=lambda a: a.sin_azimuth(2),
    ),
    Term(
        name="elevation_azimuth_second_cosine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c cos 2Az",
        separated_by=ALL_AZIMUTHS,
        elevation=lambda a: a.cos_azimuth(2),
    ),
    Term(
        name="elevation_second_sine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c sin 2El",
        separated_by=LOW_AND_HIGH,
        elevation=lambda a: a.sin_elevation(2),
    ),
    Term(
        name="elevation_second_cosine",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c cos 2El",
        separated_by=LOW_AND_HIGH,
        elevation=lambda a: a.cos_elevation(2),
    ),
    Term(
        name="droop_beyond_zenith",
        number=0,
        unit="rad",
        kind="additive",
        formula="dEl = c cos El where El > 90 deg",
        separated_by="plunged passes (elevation above 90 deg)",
        elevation=lambda a: a.cos_elevation(1) * a.beyond_zenith,
    ),
    Term(
        name="azimuth_temperature",
        number=0,
        unit="rad/K",
        kind="additive",
        formula="dAz = c (T - 288.15 K)",
        separated_by="passes at several temperatures",
        azimuth=lambda a: a.temperature_difference,
        needs_temperature=True,
    ),
    Term(
        name="elevation_temperature",
        number=0,
        unit="rad/K",
        kind="additive",
        formula="dEl = c (T - 288.15 K)",
        separated_by="passes at several temperatures",
        elevation=lambda a: a.temperature_difference,
        needs_temperature=True,
    ),
)
"""Named terms that may be added to the 14; all act on one axis only."""
