"""Ephemerides that are tables of states: operators' MEME text, CPF of laser ranging, SP3 of GNSS.

Each reader fills the `Draft` of an OEM segment, which has the checks.  None of the formats says how
to interpolate: states with velocities take Hermite of degree 7, positions alone Lagrange of degree
9.  Sources: Space-Track, "Ephemeris file formats" (modified ITC); ILRS, CPF version 2 (2018); IGS,
SP3-d (2016).
"""

import itertools
import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rf_pointing.core.dates import DAY_S, to_utc_text
from rf_pointing.ephemeris.oem import Draft, OemSegment, State, numbers_of
from rf_pointing.ephemeris.time_scales import POSIX_EPOCH_JD

Found = Iterator[OemSegment | ValueError]
_JD_OF_MJD = 2400000.5
# Written steps are whole milliseconds.
_STEP_S = 1e-2
_POSITIONS = {"INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "9"}
_POSITIONS_AND_VELOCITIES = {"INTERPOLATION": "HERMITE", "INTERPOLATION_DEGREE": "7"}
# Scales of SP3 by what an OEM calls them; Galileo and QZSS count as GPS does.
_SP3_SCALES = {"GPS": "GPS", "GAL": "GPS", "QZS": "GPS", "UTC": "UTC", "TAI": "TAI", "GLO": "UTC", "": "GPS"}


def _draft(name: str, object_id: str, frame: str, scale: str, **meta: str) -> Draft:
    return Draft({
        "OBJECT_NAME": name, "OBJECT_ID": object_id, "CENTER_NAME": "EARTH", "REF_FRAME": frame,
        "TIME_SYSTEM": scale, **meta,
    })  # fmt: skip


def _parts(draft: Draft, step_s: float | None = None) -> Found:
    """Yield the segments of a draft: a new one after every gap that is longer than its step."""
    if draft.states:
        draft.meta |= {"START_TIME": draft.states[0].epoch, "STOP_TIME": draft.states[-1].epoch}
    whole = draft.segment()
    if isinstance(whole, ValueError):
        yield whole
        return
    steps = np.diff(whole.tai_s)
    odd = np.flatnonzero(np.abs(steps - (step_s or steps)) > _STEP_S)
    if len(odd):
        after = draft.states[int(odd[0]) + 1]
        yield ValueError(f"line {after.number}: a step of {steps[odd[0]]:.3f} s, must be step_size={step_s:g} s")
        return
    cuts = [0, *(np.flatnonzero(steps > 1.5 * np.median(steps)) + 1).tolist(), len(whole.tai_s)]
    for first, last in itertools.pairwise(cuts):
        part = slice(first, last)
        # What is too short to be interpolated is a part of the gap.
        if last - first > whole.degree:
            yield replace(
                whole, tai_s=whole.tai_s[part], position_m=whole.position_m[part],
                velocity_m_s=whole.velocity_m_s[part], usable_from_s=float(whole.tai_s[first]),
                usable_to_s=float(whole.tai_s[last - 1]), covariances=whole.covariances[part],
            )  # fmt: skip


def _damaged(error: Exception, number: int, line: str) -> ValueError:
    """Return a reason that names its line."""
    if str(error).startswith("line "):
        return ValueError(str(error))
    return ValueError(f"line {number}: {line[:40]!r} is damaged or cut off")


def read_meme(text: str, name: str = "") -> Found:
    """Yield the segment of an operator's file, mean equator of J2000, with its UVW covariance.

    The object is named by the file: MEME_44713_STARLINK-1007_...
    """
    named = re.match(r"MEME_(\d+)_([^_]+)_", name)
    number, label = named.groups() if named else (name.rsplit(".", 1)[0] or "MEME",) * 2
    draft = _draft(label, number, "EME2000", "UTC", **_POSITIONS_AND_VELOCITIES)
    lines = text.splitlines()
    step = re.search(r"step_size:\s*(\d+)", text[:500])
    axes = next((line.strip() for line in lines[:6] if re.fullmatch(r"[A-Z]{3,}", line.strip())), "UVW")
    for number, line in enumerate(lines, start=1):
        fields = line.split()
        if not fields or not (draft.states or re.match(r"\d{13}", line)):
            continue
        values = numbers_of(fields, number, line)
        if len(fields) != 7:
            raise ValueError(f"line {number}: {line[:40]!r} must hold seven numbers")
        if re.fullmatch(r"\d{13}(\.\d*)?", date := fields[0]):
            epoch = f"{date[:4]}-{date[4:7]}T{date[7:9]}:{date[9:11]}:{date[11:]}"
            draft.states.append(State(number, epoch, values[1:]))
            draft.covariances.append((number, {"EPOCH": epoch, "COV_REF_FRAME": axes}, []))
        elif draft.covariances:
            draft.covariances[-1][2].extend(values)
        else:
            raise ValueError(f"line {number}: {date[:40]!r} must be a date of 13 digits")
    yield from _parts(draft, float(step[1]) if step else None)


def read_cpf(text: str, _name: str = "") -> Found:
    """Yield the segment of a consolidated prediction: Earth-fixed positions in metres."""
    draft, ended = _draft("", "", "", "UTC", **_POSITIONS), False
    for number, line in enumerate(text.splitlines(), start=1):
        fields = line.split()
        try:
            match fields[:1]:
                case ["H1" | "h1"]:
                    draft.meta["OBJECT_NAME"] = fields[9 if fields[2] == "1" else 10]
                case ["H2" | "h2"]:
                    draft.meta["OBJECT_ID"] = fields[3]
                    if fields[19] != "0":
                        raise ValueError(f"line {number}: reference frame {fields[19]} must be 0 (Earth-fixed)")
                    draft.meta["REF_FRAME"] = "ITRF"
                case ["10"]:
                    day, second, _, x, y, z = numbers_of(fields[2:8], number, line)
                    epoch = to_utc_text((day + _JD_OF_MJD - POSIX_EPOCH_JD) * DAY_S + second)
                    draft.states.append(State(number, epoch, [1e-3 * x, 1e-3 * y, 1e-3 * z]))
                case ["99"]:
                    ended = True
        except (ValueError, IndexError, OverflowError, OSError) as error:
            draft.wrong = draft.wrong or _damaged(error, number, line)
    if not ended:
        draft.wrong = draft.wrong or ValueError("CPF ends before its record 99: is the message whole?")
    yield from _parts(draft)


def read_sp3(text: str, _name: str = "") -> Found:
    """Yield the segments of every satellite of an SP3 file: Earth-fixed positions in kilometres."""
    lines = text.splitlines()
    scale = next((line[9:12].strip() for line in lines[:30] if line.startswith("%c")), "missing")
    if scale not in _SP3_SCALES:
        raise ValueError(f"line with %c: time system {scale} must be one of {', '.join(filter(None, _SP3_SCALES))}")
    found: dict[str, Draft] = {}
    epoch, epochs, ended = "", 0, False
    for number, line in enumerate(lines, start=1):
        label = line[1:4].strip()
        draft = found.setdefault(label, _draft(label, label, "ITRF", _SP3_SCALES[scale], **_POSITIONS)) \
            if line.startswith("P") else Draft()  # fmt: skip
        try:
            if line.startswith("*"):
                year, month, day, hour, minute = (int(text) for text in line[1:].split()[:5])
                epoch = f"{year:04d}-{month:02d}-{day:02d}T{hour:02d}:{minute:02d}:{float(line[20:]):011.8f}"
                epochs += 1
            elif line.startswith("P"):
                values = numbers_of([line[4:18], line[18:32], line[32:46]], number, line)
                # Zeros stand for a position that is not known.
                if any(values):
                    draft.states.append(State(number, epoch, values))
            ended |= line.startswith("EOF")
        except ValueError as error:
            draft.wrong = draft.wrong or _damaged(error, number, line)
            if line.startswith("*"):
                raise ValueError(f"line {number}: {line!r} must be an epoch") from None
    stated = lines[0][32:39].strip()
    if not ended or str(epochs) != stated:
        raise ValueError(f"line 1: SP3 has {epochs} epochs of {stated}: is the message whole?")
    for draft in found.values():
        yield from _parts(draft)
