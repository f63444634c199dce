"""Secrets in files that their owner alone may read: keys of commands, tokens, passwords."""

import fcntl
import os
import stat
from collections.abc import Callable
from pathlib import Path

from rf_pointing.core.whole_file import open_private

SHORTEST_TOKEN = 16


def secret_in(path: Path, make: Callable[[], str] | None = None) -> str:
    """Return the text of a file that its owner alone may read; an empty one gets that of `make`.

    ValueError, which begins with the path, for a file that others may read, and for none.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        opened = open_private(path, os.O_RDWR)
    except (OSError, RuntimeError) as error:
        raise ValueError(f"{path} cannot be used: {error}") from error
    with os.fdopen(opened, "r+", encoding="ascii", errors="replace") as file:
        if stat.S_IMODE(os.fstat(opened).st_mode) & 0o077:
            raise ValueError(
                f"{path} can be read by others: chmod 600 it, and replace what is in it"
            )
        # Two nodes that start at once: the first of them makes it.
        fcntl.flock(file, fcntl.LOCK_EX)
        text = file.read(1024).strip()
        if not text and make is not None:
            text = make()
            file.write(f"{text}\n")
    return text


def read_token(name: str, given: str, own: Path) -> tuple[str, Path]:
    """Return the token of the file `given`, or of `own`, which is made where it is missing.

    Raises ValueError for a file that others may read, and for a short token; it names the parameter
    `name`.
    """
    # Imported here: with it comes OpenSSL, 3.5 MB that other nodes do not need.
    import secrets

    path = Path(given).expanduser() if given else own
    if given and not path.is_file():
        raise ValueError(f"{name}={path} does not exist")
    token = secret_in(path, None if given else lambda: secrets.token_urlsafe(24))
    if (
        len(token) < SHORTEST_TOKEN
        or not token.isascii()
        or not token.isprintable()
        or " " in token
    ):
        raise ValueError(
            f"the token in {path} has {len(token)} characters, must be >= {SHORTEST_TOKEN} of plain ASCII, no spaces"
        )
    return token, path
