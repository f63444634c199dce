"""The terms of the bias model (SATCAL eqs. 1-2) and the extensions that may be added by name.

A term adds its coefficient times its partial derivatives to the azimuth and to the elevation:

    Az_o = Az_t + x1 + x2 tan El + x3 sec El + x4 sin Az + x5 cos Az + x6 Az' + x7 Az''
                + (x8 sin Az - x9 cos Az) tan El
    El_o = El_t + x8 cos Az + x9 sin Az + x10 + x11 cos El + x12 sin El + x13 El' + x14 El''

The terms that tilt or skew an axis (x2, x3, x8, x9) are rotations, of which this is the first
order.

Any other mount has the same chain between its axes (`mount`), and so the same terms under the names
of its axes, with one exception: what bends under gravity does so along the vertical, which is not
the pole of such a mount.  Its x11, `flexure`, acts on both axes (`mount.lift`), and the cosine
of the upper encoder, which droop includes, is a term to add.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from rf_pointing.calibration.angles import Angles
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION, MOUNTS
from rf_pointing.core.types import Array

Partial = Callable[[Angles], Array]
# No mount is off by 6 deg and no drive lags by 10 s: what is larger was given in another unit.
_LIMITS = {"rad": 0.1, "s": 10.0, "s^2": 100.0, "rad/K": 0.01}
# One sigma over mounts: 0.1 deg, as the printed terms of 34-m antennas.
_SIZES = {"rad": 1.7e-3, "s": 0.5, "s^2": 0.5, "rad/K": 2e-5}


@dataclass(frozen=True)
class Term:
    """One coefficient of the model and its partials, None for an axis on which it does not act.

    `number` is the index of SATCAL's x, 0 for an extension.  A "rotation" tilts or skews an axis, a
    "lag" is proportional to a rate or an acceleration, an "additive" term is an encoder or flexure
    shift of one axis, "flexure" bends the beam itself.  `separated_by` names the data that make the
    term observable.
    """

    name: str
    number: int
    unit: str
    kind: Literal["rotation", "lag", "additive", "flexure"]
    separated_by: str
    azimuth: Partial | None = None
    elevation: Partial | None = None

    @property
    def limit(self) -> float:
        """Return the largest credible magnitude in the term's unit; a larger one is in degrees."""
        return _LIMITS[self.unit]

    @property
    def size(self) -> float:
        """Return how large such a term usually is: one sigma about zero, in the term's unit."""
        return _SIZES[self.unit]


_ALL_AZIMUTHS = "passes on all sides of the sky"
_LOW_AND_HIGH = "passes at low and at high elevation (above 60 deg)"
_RISE_AND_SET = "fast passes on both sides, rising and setting, at several rates"
_TEMPERATURES = "passes at several temperatures"

TERMS: tuple[Term, ...] = (
    Term("azimuth_offset", 1, "rad", "additive", _LOW_AND_HIGH, lambda a: a.one),
    Term("non_orthogonality", 2, "rad", "rotation", _LOW_AND_HIGH, lambda a: a.tan_elevation),
    Term("collimation", 3, "rad", "rotation", _LOW_AND_HIGH, lambda a: a.sec_elevation),
    Term("azimuth_encoder_sine", 4, "rad", "additive", _ALL_AZIMUTHS, lambda a: a.sin_azimuth(1)),
    Term("azimuth_encoder_cosine", 5, "rad", "additive", _ALL_AZIMUTHS, lambda a: a.cos_azimuth(1)),
    Term("azimuth_velocity_lag", 6, "s", "lag", _RISE_AND_SET, lambda a: a.azimuth_rate),
    Term("azimuth_acceleration_lag", 7, "s^2", "lag", _RISE_AND_SET, lambda a: a.azimuth_acceleration),
    Term(
        "mislevel_east", 8, "rad", "rotation", _ALL_AZIMUTHS,
        azimuth=lambda a: a.sin_azimuth(1) * a.tan_elevation, elevation=lambda a: a.cos_azimuth(1),
    ),
    Term(
        "mislevel_north", 9, "rad", "rotation", _ALL_AZIMUTHS,
        azimuth=lambda a: -a.cos_azimuth(1) * a.tan_elevation, elevation=lambda a: a.sin_azimuth(1),
    ),
    Term("elevation_offset", 10, "rad", "additive", _LOW_AND_HIGH, elevation=lambda a: a.one),
    Term("droop", 11, "rad", "additive", _LOW_AND_HIGH, elevation=lambda a: a.cos_elevation(1)),
    Term("elevation_encoder_sine", 12, "rad", "additive", _LOW_AND_HIGH, elevation=lambda a: a.sin_elevation(1)),
    Term("elevation_velocity_lag", 13, "s", "lag", _RISE_AND_SET, elevation=lambda a: a.elevation_rate),
    Term("elevation_acceleration_lag", 14, "s^2", "lag", _RISE_AND_SET, elevation=lambda a: a.elevation_acceleration),
)  # fmt: skip
"""The 14 terms of SATCAL eqs. (1)-(2), in the paper's order."""

TERM_NAMES: tuple[str, ...] = tuple(term.name for term in TERMS)

EXTENSION_TERMS: tuple[Term, ...] = (
    Term("azimuth_second_sine", 0, "rad", "additive", _ALL_AZIMUTHS, lambda a: a.sin_azimuth(2)),
    Term("azimuth_second_cosine", 0, "rad", "additive", _ALL_AZIMUTHS, lambda a: a.cos_azimuth(2)),
    Term("elevation_azimuth_second_sine", 0, "rad", "additive", _ALL_AZIMUTHS, elevation=lambda a: a.sin_azimuth(2)),
    Term("elevation_azimuth_second_cosine", 0, "rad", "additive", _ALL_AZIMUTHS, elevation=lambda a: a.cos_azimuth(2)),
    Term("elevation_second_sine", 0, "rad", "additive", _LOW_AND_HIGH, elevation=lambda a: a.sin_elevation(2)),
    Term("elevation_second_cosine", 0, "rad", "additive", _LOW_AND_HIGH, elevation=lambda a: a.cos_elevation(2)),
    Term(
        "droop_beyond_zenith", 0, "rad", "additive", "plunged passes (elevation above 90 deg)",
        elevation=lambda a: a.cos_elevation(1) * a.beyond_zenith,
    ),
    Term("azimuth_temperature", 0, "rad/K", "additive", _TEMPERATURES, lambda a: a.temperature_difference),
    Term("elevation_temperature", 0, "rad/K", "additive", _TEMPERATURES, elevation=lambda a: a.temperature_difference),
)  # fmt: skip
"""Terms that may be added to the 14: harmonics, flexure beyond the zenith, temperature."""

FLEXURE = Term(
    "flexure", 11, "rad", "flexure", _LOW_AND_HIGH, lambda a: a.lift[0], lambda a: a.lift[1]
)
_DROOP, _LEANS = 11, ("mislevel_east", "mislevel_north")


def _of_axes(term: Term, kind: str) -> Term:
    """Return a term of azimuth and elevation as that of a mount of another kind."""
    (lower, upper), leans = MOUNTS[kind].axes, dict(zip(_LEANS, MOUNTS[kind].leans, strict=True))
    name = leans.get(term.name, term.name.replace("azimuth", lower).replace("elevation", upper))
    return FLEXURE if term.number == _DROOP else replace(term, name=name)


_UPPER_COSINE = Term(
    "elevation_encoder_cosine", 0, "rad", "additive", _LOW_AND_HIGH,
    elevation=lambda a: a.cos_elevation(1),
)  # fmt: skip
MOUNT_TERMS: Mapping[str, tuple[Term, ...]] = {
    kind: TERMS if kind == AZIMUTH_ELEVATION else tuple(_of_axes(term, kind) for term in TERMS)
    for kind in MOUNTS
}
"""The 14 terms of every mount; the number of a term says what it does."""
FURTHER_TERMS: Mapping[str, tuple[Term, ...]] = {
    kind: EXTENSION_TERMS
    if kind == AZIMUTH_ELEVATION
    else tuple(_of_axes(term, kind) for term in (*EXTENSION_TERMS, _UPPER_COSINE))
    for kind in MOUNTS
}
ALL_TERMS = {
    term.name: term
    for kind in reversed(tuple(MOUNTS))
    for term in (*MOUNT_TERMS[kind], *FURTHER_TERMS[kind])
}


def names_of(kind: str) -> tuple[str, ...]:
    """Return the names of the 14 terms of a kind of mount."""
    return tuple(term.name for term in MOUNT_TERMS[kind])


def mount_of(names: Iterable[str]) -> str:
    """Return the first kind of mount that has all these terms; ValueError where none has."""
    wanted = set(names)
    for kind in MOUNTS:
        if wanted <= {term.name for term in (*MOUNT_TERMS[kind], *FURTHER_TERMS[kind])}:
            return kind
    terms_by_name(names)
    raise ValueError(f"terms {', '.join(names)} are of different mounts")


def numbered(coefficients: Mapping[str, float], *numbers: int) -> list[float]:
    """Return the values of the terms of these numbers, whatever the mount."""
    known = {ALL_TERMS[name].number: value for name, value in coefficients.items()}
    return [known[number] for number in numbers]


def terms_by_name(names: Iterable[str], kind: str = "") -> tuple[Term, ...]:
    """Return the terms of `names` in order; raises ValueError for an unknown or repeated one.

    With a `kind` of mount those of other ones are unknown.
    """
    chosen = list(names)
    own = (
        {term.name: term for term in (*MOUNT_TERMS[kind], *FURTHER_TERMS[kind])}
        if kind
        else ALL_TERMS
    )
    unknown = [name for name in chosen if name not in own]
    if unknown:
        # Whoever names a term wrong wants those of the own mount, not all that there are.
        of = f" of a mount of type {kind}" if kind else ""
        listed = own if kind else {term.name: term for term in (*TERMS, *EXTENSION_TERMS)}
        raise ValueError(
            f"the bias model{of} has no term {', '.join(unknown)}; it has {', '.join(listed)}"
        )
    if len(set(chosen)) < len(chosen):
        repeated = sorted({name for name in chosen if chosen.count(name) > 1})
        raise ValueError(f"term {', '.join(repeated)} is given more than once")
    return tuple(own[name] for name in chosen)
