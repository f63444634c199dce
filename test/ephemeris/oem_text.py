"""Messages for the tests of OEM, and the states of a satellite for them."""

import numpy as np

from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris import Elements
from rf_pointing.ephemeris.oem import OemSegment
from rf_pointing.ephemeris.orbit_file import read_orbits

START_T_S = 1151384300.0
STEP_S = 60.0
TIMES = START_T_S + STEP_S * np.arange(15)


def text_of(states: list[np.ndarray], *, times: np.ndarray = TIMES, header: str = "", **meta: str) -> str:
    fields = {
        "OBJECT_NAME": "CBERS 2", "OBJECT_ID": "2003-049A", "CENTER_NAME": "EARTH",
        "REF_FRAME": "TEME", "TIME_SYSTEM": "UTC", "START_TIME": utc_text(times[0]),
        "STOP_TIME": utc_text(times[-1]), "INTERPOLATION": "HERMITE", "INTERPOLATION_DEGREE": "7",
        **meta,
    }  # fmt: skip
    lines = [header or "CCSDS_OEM_VERS = 2.0", "ORIGINATOR = TEST", "META_START"]
    lines += [f"{key} = {value}" for key, value in fields.items() if value]
    lines += ["META_STOP", "COMMENT states in km and km/s"]
    lines += [f"{utc_text(t)[:-1]} " + " ".join(f"{x:.9f}" for x in s) for t, s in zip(times, states, strict=True)]
    rows = [" ".join(["0.0"] * k + ["1e-6"]) for k in range(6)]
    return "\n".join([*lines, "COVARIANCE_START", "EPOCH = 2006-06-27T00:00:00", *rows, "COVARIANCE_STOP", ""])


def read_oem(text: str) -> list[OemSegment]:
    """Return the segments of a text in which every one is good."""
    found = read_orbits(text)
    if found.refused:
        raise ValueError("; ".join(found.refused))
    return found.segments


def teme_states(cbers: Elements) -> list[np.ndarray]:
    """TEME states; the velocity is the derivative of the positions, which that of SGP4 is not."""
    record, states = cbers.satrec(), []
    for minutes in (TIMES - cbers.epoch_t_s) / 60.0:
        a, b, here, c, d = (np.array(record.sgp4_tsince(minutes + k / 60.0)[1]) for k in (-2, -1, 0, 1, 2))
        states.append(np.concatenate([here, (a - 8.0 * b + 8.0 * c - d) / 12.0]))
    return states
