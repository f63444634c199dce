"""Files of orbits in any of the formats in use: one table, one loop.

The first format whose pattern fits the beginning of a text reads it.  Its reader yields elements
and segments, a ValueError for every one that is damaged, and a UserWarning for what is odd.  The
good ones are used, the bad ones are listed.  Formats without a reader are named, so that nobody
looks for a fault in a file of another kind.

What was read of a large file is kept as rows in the cache folder, under the digest of its bytes and
of the readers: another file cannot be taken for it.  Its own digest tells where it is damaged.
"""

import codecs
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from rf_pointing.core.whole_file import DATA_BYTES, JOURNAL_BYTES, read_bytes, write_whole
from rf_pointing.ephemeris.element_files import cache_folder
from rf_pointing.ephemeris.element_messages import read_json, read_omm_csv, read_omm_kvn, read_omm_xml
from rf_pointing.ephemeris.elements import Elements, to_row
from rf_pointing.ephemeris.oem import OemSegment, read_oem, read_oem_xml
from rf_pointing.ephemeris.state_tables import read_cpf, read_meme, read_sp3
from rf_pointing.ephemeris.tle import read_tle

Reader = Callable[[str, str], Iterator[Elements | OemSegment | ValueError | UserWarning]]


class Format(NamedTuple):
    """A format by the beginning of its text; None reads what is only named."""

    name: str
    begins: str
    read: Reader | None = None


FORMATS = (
    Format("a web page", r"<!doctype html|<html"),
    Format("an OEM in XML", r"(?=[\s\S]{0,4000}<(\w+:)?oem\b)<", read_oem_xml),
    Format("an OMM in XML", r"(?=[\s\S]{0,4000}<(\w+:)?(omm|ndm|segment)\b)<", read_omm_xml),
    Format("JSON", r"\[\s*\[(?!\w)|[\[{]\s*[{\"\]}]", read_json),
    Format("an OEM", r"(COMMENT.*\s+)*CCSDS_OEM_VERS", read_oem),
    Format("an OMM", r"(COMMENT.*\s+)*CCSDS_OMM_VERS|COMMENT", read_omm_kvn),
    Format("another CCSDS message than an OMM or OEM", r"CCSDS_\w+_VERS"),
    Format("an OMM table", r"[^\n]*MEAN_MOTION[^\n]*[,;\t]|[^\n]*[,;\t][^\n]*MEAN_MOTION", read_omm_csv),
    Format("MEME text", r"created:.*\s+ephemeris_start:|\d{13}\.\d{3} ", read_meme),
    Format("CPF", r"H1\s+CPF", read_cpf),
    Format("SP3", r"#[abcd][PV]\d{4}", read_sp3),
    Format("AMSAT's elements in words", r"satellite:.*\s+catalog number:"),
    Format("an STK ephemeris", r"stk\.v\."),
    Format("RINEX", r".{60}RINEX VERSION"),
    Format("a YUMA almanac", r"\*+ *Week"),
    Format("a SPICE kernel", r"DAF/|KPL/"),
    Format("a calendar", r"BEGIN:VCALENDAR"),
    Format("compressed", r"\x1f|PK\x03\x04|BZh|\ufffd7zXZ|\(\ufffd/\ufffd"),
    Format("a PDF", r"%PDF"),
    Format("a station description", r"(#.*\s+)*version:"),
    Format("TLE", "", read_tle),
)
"""Formats in the order in which they are tried; text with lines of a TLE in it is TLE."""
MOST_LISTED = 10
LARGE_BYTES = 256 * 1024
"""Smaller files are read faster than they are looked up."""
MOST_KEPT = 8


@dataclass(frozen=True)
class OrbitFile:
    """Content of a text: its format, the good orbits, and the refused ones, each with its line."""

    format: str
    elements: list[Elements] = field(default_factory=list)
    segments: list[OemSegment] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def problems(self) -> list[str]:
        """The refused ones, as many as anybody reads, then one note."""
        more = len(self.refused) - MOST_LISTED
        last = [f"and {more} more are refused"] if more > 0 else []
        return [*self.refused[:MOST_LISTED], *last, *self.notes[:1]]


def read_orbits(text: str, name: str = "") -> OrbitFile:
    """Return what the text of file `name` holds; ValueError for one without a single good orbit."""
    text = text.removeprefix("\ufeff")
    form = next(form for form in FORMATS if re.match(rf"(?i)\s*(?:{form.begins})", text))
    found = OrbitFile(form.name)
    begins = " ".join(text[:200].split())[:40]
    if form.read is None:
        raise ValueError(f"text holds no elements, it looks like {form.name}: it starts with {begins!r}")
    try:
        for each in form.read(text, name):
            if isinstance(each, Elements):
                found.elements.append(each)
            elif isinstance(each, OemSegment):
                found.segments.append(each)
            else:
                (found.notes if isinstance(each, UserWarning) else found.refused).append(str(each))
    except ValueError as error:
        found.refused.append(str(error))
    if not found.elements and not found.segments:
        what = "text" if form.name == "TLE" else form.name
        none = f"{what} holds no elements; it starts with {begins!r}"
        raise ValueError("; ".join(found.problems) or none)
    return found


class OrbitRows(NamedTuple):
    """Content of a file, its elements as rows of `elements.to_row`."""

    rows: list[list[Any]]
    segments: list[OemSegment]
    problems: list[str]


def read_orbit_file(path: Path) -> OrbitRows:
    """Return what a file holds; a byte that is not UTF-8 costs the line that it is in."""
    data = read_bytes(path, DATA_BYTES)
    if len(data) >= LARGE_BYTES:
        try:
            whole, _, text = read_bytes(_kept_file(data), JOURNAL_BYTES).partition(b"\n")
            if whole == _digest(text).encode():
                return OrbitRows(**json.loads(text))
        except (OSError, RuntimeError):
            # It was not read before, or the user has no folder to keep it in.
            pass
    return keep_orbits(data, read_orbits(decoded(data), path.name))


def keep_orbits(data: bytes, read: OrbitFile) -> OrbitRows:
    """Return what was `read` of bytes as rows, kept for the next reader where they are many."""
    found = OrbitRows([to_row(one) for one in read.elements], read.segments, read.problems)
    if len(data) >= LARGE_BYTES and not found.segments:
        text = json.dumps(found._asdict()).encode()
        try:
            file = _kept_file(data)
            write_whole(file, _digest(text).encode() + b"\n" + text)
            for old in sorted(file.parent.glob("*.rows"), key=lambda path: path.stat().st_mtime_ns)[:-MOST_KEPT]:
                old.unlink(missing_ok=True)
        except (OSError, RuntimeError):
            # A full disk, or another process that keeps them as well: the file is read again.
            pass
    return found


def _kept_file(data: bytes) -> Path:
    # Readers that were changed may take what they refused before.
    readers = [path.stat().st_mtime_ns for path in sorted(Path(__file__).parent.glob("*.py"))]
    return cache_folder(name="catalogues") / f"{_digest(f'{readers}'.encode() + data)}.rows"


def _digest(data: bytes) -> str:
    # Imported here: OpenSSL takes 3.5 MB, and few stations have large files.
    import hashlib

    return hashlib.sha256(data).hexdigest()


def decoded(data: bytes) -> str:
    """Return text as editors and shells write it: UTF-8, or UTF-16 with its mark."""
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = data.decode("utf-16" if wide else "utf-8", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_elements(text: str) -> list[Elements]:
    """Return the elements of a text in which every set is good; ValueError names the bad ones."""
    found = read_orbits(text)
    if found.refused or not found.elements:
        raise ValueError("; ".join(found.problems) or f"{found.format} holds an ephemeris and no elements")
    return found.elements
