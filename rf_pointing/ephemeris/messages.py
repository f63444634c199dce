"""Reading elements from text of any supported form: the form is recognised from the text itself."""

from collections.abc import Callable

from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.omm import read_omm_csv, read_omm_json, read_omm_kvn, read_omm_xml
from rf_pointing.ephemeris.tle import read_tle

__all__ = ["read_elements"]


def read_elements(text: str) -> list[Elements]:
    """Return all elements in TLE, 3LE or OMM (JSON, XML, CSV, KVN) text; a text that holds none is refused."""
    content = text.removeprefix("\ufeff").strip()
    found = _reader(content)(content)
    if not found:
        raise ValueError(f"text holds no elements; it starts with {content[:40]!r}")
    return found


def _reader(content: str) -> Callable[[str], list[Elements]]:
    first_line = content.split("\n", 1)[0]
    if content.startswith(("{", "[")):
        return read_omm_json
    if content.startswith("<"):
        return read_omm_xml
    if "," in first_line and "MEAN_MOTION" in first_line:
        return read_omm_csv
    if content.startswith(("CCSDS_OMM_VERS", "COMMENT")):
        return read_omm_kvn
    if content.startswith("CCSDS_"):
        raise ValueError(
            f"{first_line.split('=')[0].strip()} must be CCSDS_OMM_VERS, or CCSDS_OEM_VERS of an ephemeris"
        )
    return read_tle
