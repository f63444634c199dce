"""Orbit check: does an orbit from corrected angles agree with the reference better than one from raw angles?"""

from rf_pointing.papers.orbit.batch import Arc, OrbitResult, fit_orbit, times_of
from rf_pointing.papers.orbit.disturbances import Disturbances
from rf_pointing.papers.orbit.earth import Site
from rf_pointing.papers.orbit.elements import Elements
from rf_pointing.papers.orbit.measurements import Look, look
from rf_pointing.papers.orbit.motion import Gravity, propagate
from rf_pointing.papers.orbit.preliminary import preliminary_orbit
from rf_pointing.papers.orbit.visits import visits

__all__ = [
    "Arc",
    "Disturbances",
    "Elements",
    "Gravity",
    "Look",
    "OrbitResult",
    "Site",
    "fit_orbit",
    "look",
    "preliminary_orbit",
    "propagate",
    "times_of",
    "visits",
]
