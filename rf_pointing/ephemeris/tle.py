"""Two-line and three-line elements (TLE, 3LE), read wherever they stand, and written.

Columns as in Spacetrack Report 3 and the CelesTrak FAQ.  Comment lines start with '#'.  Text after
column 69 is ignored (the SGP4 verification file keeps its time grid there).  What does not fit the
columns is an error with its name; nothing is cut off.

Catalogue numbers above 99999 are written in Alpha-5: the first of the five characters stands for
the two leading digits, A = 10 ... Z = 33 without I and O, so 339999 (Z9999) is the largest.
"""

import math
import re
from calendar import isleap
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from sgp4.alpha5 import from_alpha5, to_alpha5

from rf_pointing.core.checks import name_of
from rf_pointing.core.dates import DAY_S, require_day_of_year
from rf_pointing.ephemeris.elements import MEAN_MOTIONS, Elements

_LENGTH = 69
_TURN_DEG = (0.0, 360.0)
# What a character counts in a checksum.
_WEIGHTS = bytes(code - 48 if 48 <= code <= 57 else code == 45 for code in range(256))
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)")
_EXPONENT = re.compile(r"\s*([+-]?)\s*(\d{5})\s*([+-]?)\s*(\d)")
_DESIGNATOR = re.compile(r"\d{5}[A-Z]{1,3}")
# Objects of the verification file that provoke errors; their checksums were not kept up.
_BROKEN_ON_PURPOSE = {"33333", "33334", "33335"}
_ALPHA5 = re.compile(r"[0-9]{1,5}|[A-HJ-NP-Z][0-9]{4}")
_LARGEST_ALPHA5 = 339999
SGP4_XP = "4"
"""Ephemeris type of elements that only SGP4-XP propagates."""
# Quotes, keys, tags and separators of tables; none of them occurs in a TLE.
_AROUND = re.compile(r"""[\"'<>|;,=:\t]+\s*""")
_FIELD = re.compile(r"""\"[^\"]*\"|'[^']*'|[^\"';,=:\t]+""")
_KEYS = "name|tle0|nickname|version|website|status|tle"
_NAMED = re.compile(rf"(?:- *)?({_KEYS})\s*[=:]\s*(.*)", re.IGNORECASE)
# Names of columns and keys around a TLE.
_KEY = re.compile(
    r"/?\W*(id|name|norad\w*|cat\w*|satellite|sat|tle|((tle|line|l)[ _]?(line)?[ _]?[012]))?", re.IGNORECASE
)
# Bulletins explain the columns with letters: 1 AAAAAU 00  0  0 BBBBB.BBBBBBBB ...
_LIKE_TLE = re.compile(r"[12] (?!AAAAA)(?=[ \dA-Z]{5}|.{60})")
_LEAST_INSIDE = 60
# Without a checksum only the places of points and blanks tell that no column is lost.
_BARE = (
    r"1 .{6} .{8} [ \d]{5}\.\d{8} [ +\-0]\.\d{8} ([ +-]\d{5}[+-]\d ){2}. [ \d]{4}",
    r"2 .{5}( [ \d]{3}\.\d{4}){2} \d{7}( [ \d]{3}\.\d{4}){2} [ \d]\d\.\d{8}[ \d]{5}",
)


def read_tle(text: str, _name: str = "") -> Iterator[Elements | ValueError | UserWarning]:
    """Yield the elements of the TLE lines in a text, and what is wrong with a line of it.

    The lines may stand in a bulletin, behind a key or a quote, or indented; the name is the text
    before them.
    """
    name, first = "", (0, "")
    for number, line in enumerate(map(str.strip, (*text.splitlines(), "end")), start=1):
        if not line or line.startswith("#"):
            continue
        for piece in tle_columns(line) or [""]:
            if first[1] and piece[:1] == "2":
                try:
                    yield _of_lines(first, (number, piece), name)
                    if len(piece) < _LENGTH:
                        yield UserWarning(f"line {number}: object {piece[2:7]} has no checksum")
                except ValueError as error:
                    yield error
                name, first = "", (0, "")
                continue
            if first[1]:
                yield ValueError(f"line {first[0]}: the text has no line 2 after {first[1][:24]!r}")
            if piece[:1] == "2":
                yield ValueError(f"line {number}: line 2 of a TLE without line 1: {piece[:24]!r}")
            first = (number, piece) if piece[:1] == "1" else (0, "")
            if not first[1]:
                name = _name_in(line, name)
            elif piece != line:
                name = _name_in(line.partition(piece)[0], name, table=True)


def tle_columns(line: str) -> list[str]:
    """Return what looks like a line of a TLE in a line of any text, whole or damaged."""
    pieces = [line] if _LIKE_TLE.match(line) else [piece.strip() for piece in _AROUND.split(line)]
    # A short piece counts where a line begins: it may be the rest of a damaged one.
    whole = [pieces[0], *(piece for piece in pieces[1:] if len(piece) >= _LEAST_INSIDE)]
    return [piece for piece in whole if _LIKE_TLE.match(piece)]


def _name_in(text: str, before: str, *, table: bool = False) -> str:
    """Return the name in a text above or before the elements; the one `before` where it has none.

    What stands before them on their line is of a `table`: the last field that is not a key.
    """
    text = re.sub(r"</?[A-Za-z]\w*>", "|", text)
    if table:
        fields = text.split("|") if "|" in text else _FIELD.findall(text)
        fields = [each.strip(" \"'") for each in fields]
        names = [each for each in fields if re.search(r"[^\W\d_]", each) and not _KEY.fullmatch(each)]
        return names[-1] if names else before
    # Keys of Gpredict's files and of YAML; any other text with an equals sign is a name.
    key = _NAMED.match(text)
    if key is not None:
        return key[2].strip(" \"'") if key[1].casefold() in ("name", "tle0") else before
    if _AROUND.search(text) and all(_KEY.fullmatch(each.strip()) for each in _AROUND.split(text)):
        return before
    return text.removeprefix("0 ").lstrip(" \"'([{|>-*").rstrip(" \"',;|")


def number_from_alpha5(text: str) -> int:
    """Return the catalogue number of the five columns; the inverse is `alpha5_from_number`."""
    columns = text.strip()
    # sgp4's decoder takes I, O and lower case as letters too: it would follow another object.
    if not _ALPHA5.fullmatch(columns):
        form = "neither digits nor Alpha-5 (a letter except I and O, four digits)"
        raise ValueError(f"catalogue number {text!r} is {form}")
    return int(from_alpha5(columns))


def alpha5_from_number(number: int) -> str:
    """Return the five columns of a catalogue number in [0, 339999]; ValueError for another."""
    if not 0 <= number <= _LARGEST_ALPHA5:
        raise ValueError(f"catalogue_number={number} must be in [0, {_LARGEST_ALPHA5}] to fit a TLE; use OMM")
    return str(to_alpha5(number))


def _of_lines(first: tuple[int, str], second: tuple[int, str], name: str) -> Elements:
    """Return the elements of two lines; checks form, checksums, numbers and the same object."""
    (number1, line1), (number2, line2) = first, second
    # Old tools leave the column of the checksum out, of both lines: one alone has lost a column.
    bare = len(line1) == len(line2) == _LENGTH - 1
    _check_line(line1, "1", number1, _BARE[0] if bare else None)
    _check_line(line2, "2", number2, _BARE[1] if bare else None)
    try:
        # Two lines of different objects can each have a right checksum.
        if number_from_alpha5(line1[2:7]) != number_from_alpha5(line2[2:7]):
            raise ValueError(f"line 2 is of object {line2[2:7]}, line 1 of {line1[2:7]}")
        return _elements(line1, line2, name)
    except ValueError as error:
        raise ValueError(f"line {number1}: {error}") from None


def verification_elements() -> list[Elements]:
    """Return the sound elements of SGP4-VER.TLE in the sgp4 package, named after its comments."""
    import sgp4

    text = (Path(sgp4.__file__).parent / "SGP4-VER.TLE").read_text(encoding="ascii")
    kept: list[str] = []
    comment = ""
    for line in text.splitlines():
        if line.startswith("#"):
            match = re.match(r"#   (\w[^#]*)", line)
            comment = match[1].strip() if match else comment
        elif line[2:7] not in _BROKEN_ON_PURPOSE:
            kept += [comment, line] if line.startswith("1 ") and comment else [line]
            comment = ""
    return [one for one in read_tle("\n".join(kept)) if isinstance(one, Elements)]


def checksum(line: str) -> int:
    """Return the last digit of the sum of columns 1 to 68, a minus sign counting 1."""
    return sum(line[: _LENGTH - 1].encode("ascii", "replace").translate(_WEIGHTS)) % 10


def _check_line(line: str, kind: str, number: int, bare: str | None) -> None:
    # One column too many: the checksum of a shifted line is right one time in ten.
    shifted = len(line) > _LENGTH and not line[_LENGTH].isspace()
    if bare is None and (len(line) < _LENGTH or shifted):
        raise ValueError(f"line {number}: TLE line has {len(line)} columns, must have {_LENGTH}: {line!r}")
    if not line[:_LENGTH].isascii() or line[0] != kind or line[1] != " ":
        raise ValueError(f"line {number}: expected line {kind} of a TLE, found {line[:24]!r}")
    if bare is not None:
        if not re.fullmatch(bare, line):
            raise ValueError(f"line {number}: TLE line without a checksum has its columns misplaced: {line!r}")
        return
    stated, counted = line[_LENGTH - 1], checksum(line)
    if stated != str(counted):
        raise ValueError(f"line {number}: checksum of object {line[2:7]} is {counted}, the line states {stated}")


def _elements(line1: str, line2: str, name: str) -> Elements:
    per_day = 2.0 * math.pi / DAY_S
    if line1[62] == SGP4_XP:
        raise ValueError("ephemeris type 4 is SGP4-XP, another theory than SGP4")
    catalogue_number = number_from_alpha5(line1[2:7])
    epoch_t_s = _read_epoch(line1[18:20], line1[20:32])
    half_dot = _number("mean motion derivative", line1[33:43], -1.0, 1.0)
    sixth_ddot = _read_exponent("second derivative", line1[44:52])
    return Elements(
        name=name_of(name) or str(catalogue_number), catalogue_number=catalogue_number,
        classification=line1[7].strip() or "U",
        international_designator=_read_designator(line1[9:17].strip()), epoch_t_s=epoch_t_s,
        mean_motion_dot_rad_s2=2.0 * half_dot * per_day / DAY_S,
        mean_motion_ddot_rad_s3=6.0 * sixth_ddot * per_day / DAY_S**2,
        drag_per_earth_radius=_read_exponent("B*", line1[53:61]),
        element_set_number=int(line1[64:68].strip() or 0),
        inclination_rad=math.radians(_number("inclination", line2[8:16], 0.0, 180.0)),
        ascending_node_rad=math.radians(_number("ascending node", line2[17:25], *_TURN_DEG)),
        eccentricity=_number("eccentricity", "0." + line2[26:33].replace(" ", "0")),
        argument_of_perigee_rad=math.radians(_number("argument of perigee", line2[34:42], *_TURN_DEG)),
        mean_anomaly_rad=math.radians(_number("mean anomaly", line2[43:51], *_TURN_DEG)),
        mean_motion_rad_s=_number("mean motion", line2[52:63], *MEAN_MOTIONS) * per_day,
        revolution_number=int(line2[63:68].strip() or 0),
    )  # fmt: skip


def _number(what: str, columns: str, low: float = -math.inf, high: float = math.inf) -> float:
    text = columns.strip()
    if not _NUMBER.fullmatch(text):
        raise ValueError(f"{what} {columns!r} is not a number")
    value = float(text)
    if not low <= value <= high:
        raise ValueError(f"{what} {text} must be in [{low:g}, {high:g}]")
    return value


def _read_exponent(what: str, columns: str) -> float:
    """Return a number with assumed decimal point, as ' 28098-4' for 0.28098e-4; blank is zero."""
    if not columns.strip():
        return 0.0
    match = _EXPONENT.fullmatch(columns)
    if not match:
        raise ValueError(f"{what} {columns!r} must be five digits and an exponent")
    sign, digits, exponent_sign, exponent = match.groups()
    return float(f"{sign}0.{digits}e{exponent_sign}{exponent}")


def _read_epoch(year: str, day: str) -> float:
    if not year.strip().isdigit():
        raise ValueError(f"epoch year {year!r} must be two digits")
    # Two digits: 57 is Sputnik's year, so they mean 1957 to 2056.
    full_year = int(year) + (1900 if int(year) >= 57 else 2000)
    day_of_year = _number("epoch day", day)
    require_day_of_year(f"{year}{day}", full_year, day_of_year)
    return datetime(full_year, 1, 1, tzinfo=UTC).timestamp() + (day_of_year - 1.0) * DAY_S


def _read_designator(columns: str) -> str:
    """Return 1998-067A for 98067A; other text as it stands."""
    if not _DESIGNATOR.fullmatch(columns):
        return columns
    return f"{1900 + int(columns[:2]) + (100 if int(columns[:2]) < 57 else 0)}-{columns[2:]}"


def tle_lines(elements: Elements) -> tuple[str, str]:
    """Return both lines; the inverse is `read_elements`.

    Raises ValueError for a catalogue number above 339999, an epoch outside 1957-2056 and numbers
    too large for their columns.
    """
    # Not `sgp4.exporter`: it widens a line silently when a number does not fit, writes 360.0000 for
    # an angle just below a turn, and knows no label above 339999.
    number = alpha5_from_number(elements.catalogue_number)
    day = DAY_S / (2.0 * math.pi)
    first = (
        f"1 {number}{elements.classification:1.1s} {_write_designator(elements.international_designator):8.8s} "
        f"{_write_epoch(elements.epoch_t_s)} {_write_fraction(0.5 * elements.mean_motion_dot_rad_s2 * day * DAY_S)} "
        f"{_write_exponent('mean_motion_ddot_rad_s3', elements.mean_motion_ddot_rad_s3 * day * DAY_S**2 / 6.0)} "
        f"{_write_exponent('drag_per_earth_radius', elements.drag_per_earth_radius)} 0 {elements.element_set_number:4d}"
    )
    second = (
        f"2 {number} {math.degrees(elements.inclination_rad):8.4f} {_write_degrees(elements.ascending_node_rad)} "
        f"{round(elements.eccentricity * 1e7):07d} {_write_degrees(elements.argument_of_perigee_rad)} "
        f"{_write_degrees(elements.mean_anomaly_rad)} {elements.mean_motion_rad_s * day:11.8f}"
        f"{elements.revolution_number:5d}"
    )
    for line in (first, second):
        if len(line) != 68:
            raise ValueError(f"elements of {elements.name} do not fit the columns of a TLE: {line!r}")
    return first + str(checksum(first)), second + str(checksum(second))


def _write_degrees(angle_rad: float) -> str:
    # Rounded first: 359.99999 would be printed as 360.0000, outside the columns' range.
    return f"{round(math.degrees(angle_rad) % 360.0, 4) % 360.0:8.4f}"


def _write_epoch(t_s: float) -> str:
    year = datetime.fromtimestamp(t_s, tz=UTC).year
    day = round(1.0 + (t_s - datetime(year, 1, 1, tzinfo=UTC).timestamp()) / DAY_S, 8)
    # The last 0.4 ms of a year round to a day that it does not have.
    if day >= (367 if isleap(year) else 366):
        year, day = year + 1, 1.0
    if not 1957 <= year <= 2056:
        raise ValueError(f"epoch_t_s={t_s} is in {year}, must be in 1957 to 2056 to fit a TLE")
    return f"{year % 100:02d}{day:012.8f}"


def _write_fraction(value: float) -> str:
    if not abs(value) < 0.999999995:
        raise ValueError(f"mean_motion_dot_rad_s2 is {value} rev/day^2, must be below 1 to fit a TLE")
    return f"{value:+.8f}".replace("+0.", " .").replace("-0.", "-.")


def _write_exponent(name: str, value: float) -> str:
    """Return ' 28098-4' for 0.28098e-4; what is below the smallest exponent is zero."""
    if value == 0.0:
        return " 00000-0"
    mantissa, exponent = f"{abs(value):.4e}".split("e")
    power = int(exponent) + 1
    if power > 9:
        raise ValueError(f"{name}={value} must be below 1e9 to fit a TLE")
    # One digit of exponent: what is smaller has no effect on any orbit.
    if power < -9:
        return " 00000-0"
    digits = mantissa.replace(".", "")
    return f"{'-' if value < 0.0 else ' '}{digits}{'+' if power > 0 else '-'}{abs(power)}"


def _write_designator(designator: str) -> str:
    """Return 98067A for 1998-067A; other text as it stands."""
    year, separator, rest = designator.partition("-")
    return f"{year[2:]}{rest}" if separator and len(year) == 4 else designator
