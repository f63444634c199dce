"""Where elements are: in a file, in a folder of files, or at an http(s) address.

Nothing here uses the network.  `fetch_elements` keeps the answer of an address as a file of the
cache folder; an address stands for that file.  The cache folder is itself a folder of elements.
"""

import os
import re
from pathlib import Path
from urllib.parse import urlsplit

# What a folder is searched for; other files in it (notes, scripts, half-written ones) are no
# elements.
SUFFIXES = (
    ".elements", ".tle", ".3le", ".txt", ".json", ".csv", ".xml", ".kvn", ".omm", ".oem", ".sat", ".cpf", ".sp3",
)  # fmt: skip


def is_address(location: str) -> bool:
    """Return whether elements come from a server."""
    return location.casefold().startswith(("http://", "https://"))


def cache_folder(stated: str = "", name: str = "elements") -> Path:
    """Return the stated folder, or the one of the XDG base directories."""
    if stated:
        return Path(stated)
    # A relative XDG_CACHE_HOME is to be ignored, says the XDG specification.
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / "rf_pointing" / name


def kept_file(address: str, folder: Path, suffix: str = ".elements") -> Path:
    """Return the file that keeps what `address` answered; ValueError for one without a host."""
    parts = urlsplit(address)
    if not is_address(address) or not parts.hostname:
        raise ValueError(f"elements={address!r} must be an address such as https://celestrak.org/…")
    words = re.sub(r"[^A-Za-z0-9.=]+", "_", f"{parts.hostname}{parts.path}_{parts.query}").strip("_")
    # The digest keeps apart what the words have in common; they are for people.
    # Imported here: OpenSSL takes 3.5 MB, and few stations fetch their elements.
    import hashlib

    digest = hashlib.sha256(address.encode()).hexdigest()[:8]
    return folder / f"{words[:120]}-{digest}{suffix}"


def element_files(location: str) -> list[Path]:
    """Return the files behind a file, folder or address; ValueError without one."""
    if is_address(location):
        kept = kept_file(location, cache_folder())
        if not kept.is_file():
            raise ValueError(f"elements={location!r} has not been fetched: run fetch_elements '{location}'")
        return [kept]
    path = Path(location)
    if path.is_dir():
        found = sorted(p for p in path.iterdir() if p.is_file() and p.name[0] != "." and p.suffix.lower() in SUFFIXES)
        if not found:
            none = f"no file ends in {', '.join(SUFFIXES)}"
            raise ValueError(f"elements={location!r} is a folder without elements: {none}")
        return found
    if not path.is_file():
        raise ValueError(f"elements={location!r} does not exist")
    return [path]


def version_of(location: str) -> tuple[tuple[str, int, int], ...]:
    """Return what changes when the elements at `location` do, empty while it has no elements."""
    try:
        status = [(str(path), path.stat()) for path in element_files(location)] if location else []
    except (ValueError, OSError):
        return ()
    return tuple((name, found.st_mtime_ns, found.st_size) for name, found in status)
