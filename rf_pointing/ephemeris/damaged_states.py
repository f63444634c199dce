"""Find the one state of a table that no orbit through its neighbours has: a damaged row.

Neighbouring states are tied by the Earth's pull, J2 included (a, with its rate j).  Two states with
velocities, h apart, and three positions (here at even steps h) leave

    dr = r' - r - h (v + v')/2 - h^2 (a - a')/12           truncation (w h)^5 r / 720
    dv = v' - v - h (a + a')/2 - h^2 (j - j')/12
    d  = r" - 2 r' + r - h^2 (a" + 10 a' + a)/12           (w h)^6 r / 240, Numerov

each also for every other state.  A damaged state breaks its own ties and no others.  A manoeuvre
lies between two states: the broken ties have none in common, and nothing is refused.  In one place
ties that are weak next to the strongest are not counted: they are truncation, near a perigee.
"""

import numpy as np

from rf_pointing.core import EARTH_MU_M3_S2, EARTH_RADIUS_M, Array
from rf_pointing.ephemeris.celestial_frame import EARTH_RATE_RAD_S

OFF_M = 100.0
"""Misfit of a tie that counts as broken; it points a quarter of a beam away at most."""
_J2 = 1.0826e-3
# Derivatives near the perigee of an eccentric orbit exceed those of a circle by so much.
_ECCENTRIC = 30.0
# What grows from tie to tie passes the bound at some state; a damaged one stands out by more.
_SOUND_SHARE = 1.0 / 3.0
# Rows of a tie, its misfit in m, and the share of the misfit that it may have.
_Tie = tuple[tuple[int, ...], float, float]


def damaged_state(tai_s: Array, position_m: Array, velocity_m_s: Array | None, *, turning: bool) -> tuple[int, float]:
    """Return the first damaged state and how far off it lies [m]; (-1, 0.0) for a sound table.

    Parameters
    ----------
    tai_s : times (n,), increasing.
    position_m, velocity_m_s : states (n, 3), None for a table of positions alone.
    turning : whether the axes turn with the Earth.
    """
    r, v = position_m, velocity_m_s
    if turning:
        r, v = _inertial(tai_s - tai_s[0], r, v)
    a, j = _pull(r, v)
    distance = np.linalg.norm(r, axis=1)
    fast = np.sqrt(EARTH_MU_M3_S2 / distance**3)
    if v is not None:
        fast = np.maximum(fast, np.linalg.norm(v, axis=1) / distance)
    doubtful: list[_Tie] = []
    rows: tuple[int, ...]
    sound = np.zeros(len(r), dtype=bool)
    for k in (1, 2):
        if v is not None:
            h = (tai_s[k:] - tai_s[:-k])[:, None]
            dr = r[k:] - r[:-k] - h * (v[k:] + v[:-k]) / 2.0 - h * h * (a[:-k] - a[k:]) / 12.0
            dv = v[k:] - v[:-k] - h * (a[k:] + a[:-k]) / 2.0 - h * h * (j[:-k] - j[k:]) / 12.0
            off = np.maximum(np.linalg.norm(dr, axis=1), np.linalg.norm(dv * h, axis=1))
            rows, steps, order, divisor = (0, k), h[:, 0], 5, 720.0
        else:
            h, g = (tai_s[2 * k :] - tai_s[k:-k])[:, None], (tai_s[k:-k] - tai_s[: -2 * k])[:, None]
            up, down = (a[2 * k :] - a[k:-k]) / h, (a[k:-k] - a[: -2 * k]) / g
            rate, bend = (up * g + down * h) / (g + h), 2.0 * (up - down) / (g + h)
            mean = a[k:-k] + (h - g) / 3.0 * rate + (h * h - h * g + g * g) / 12.0 * bend
            ties = (r[2 * k :] - r[k:-k]) / h - (r[k:-k] - r[: -2 * k]) / g - 0.5 * (g + h) * mean
            off = np.linalg.norm(2.0 * g * h / (g + h) * ties, axis=1)
            rows, steps, order = (0, k, 2 * k), np.maximum(g, h)[:, 0], 6
            divisor = 240.0
        first = np.arange(len(off))
        fastest, far = (np.maximum.reduce([each[first + row] for row in rows]) for each in (fast, distance))
        most = OFF_M + _ECCENTRIC * (fastest * steps) ** order * far / divisor
        share = off / most
        doubtful += [
            (tuple(int(i) + each for each in rows), float(off[i]), float(share[i]))
            for i in np.flatnonzero(share > _SOUND_SHARE)
        ]
        for each in rows if k == 1 else ():
            sound[np.flatnonzero(share <= _SOUND_SHARE) + each] = True
    return _common(sorted(doubtful), sound)


def _common(ties: list[_Tie], sound: Array) -> tuple[int, float]:
    """Return the state that the doubtful ties of one place share, and the least misfit there.

    One of them must be broken.  Of several states that of no sound tie counts: at the ends of a
    table there are few ties.
    """
    place: list[_Tie] = []
    last = -1
    for tie in [*ties, ((2**62,), 0.0, 0.0)]:
        if tie[0][0] > last:
            strongest = max((off for _, off, _ in place), default=0.0)
            counted = [one for one in place if _ECCENTRIC * one[1] > strongest]
            shared = set.intersection(*(set(rows) for rows, _, _ in counted)) if counted else set()
            shared = {each for each in shared if not sound[each]}
            if len(shared) == 1 and max(share for _, _, share in counted) > 1.0:
                return shared.pop(), min(off for _, off, _ in counted)
            place = []
        place.append(tie)
        last = max(last, *tie[0])
    return -1, 0.0


def _inertial(t_s: Array, r: Array, v: Array | None) -> tuple[Array, Array | None]:
    """Return states in axes that stand still, those of the first time."""
    cos, sin = np.cos(EARTH_RATE_RAD_S * t_s), np.sin(EARTH_RATE_RAD_S * t_s)

    def turned(vector: Array) -> Array:
        x, y, z = vector.T
        return np.array([cos * x - sin * y, sin * x + cos * y, z]).T

    return turned(r), None if v is None else turned(v + np.cross([0.0, 0.0, EARTH_RATE_RAD_S], r))


def _pull(r: Array, v: Array | None) -> tuple[Array, Array]:
    """Return acceleration and, where there are velocities, the rate of its main part."""
    squared = np.sum(r * r, axis=1)[:, None]
    point = -EARTH_MU_M3_S2 / squared**1.5
    high = 5.0 * r[:, 2:] ** 2 / squared
    oblate = 1.5 * _J2 * EARTH_RADIUS_M**2 / squared * (high - [1.0, 1.0, 3.0])
    a = point * r * (1.0 - oblate)
    if v is None:
        return a, a
    return a, point * (v - 3.0 * r * np.sum(r * v, axis=1)[:, None] / squared)
