"""Keeps every certificate as a JSON file, written whole or not at all."""

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from rf_pointing.core import Params, parameter
from rf_pointing.core.whole_file import write_whole
from rf_pointing.planning import Certificate, certificate_values

__all__ = ["StoreParams", "store_certificate"]


@dataclass(frozen=True, kw_only=True)
class StoreParams(Params):
    """Where certificates are kept."""

    certificate_folder: str = parameter("", "folder of the stored certificates; empty: they are only published")


def store_certificate(params: StoreParams, certificate: Certificate) -> Path | None:
    """Write the certificate to the folder, named after target and acquisition; return the file, None without a folder."""
    if not params.certificate_folder:
        return None
    name = "".join(letter if letter.isalnum() else "_" for letter in certificate.name)
    path = (
        Path(params.certificate_folder)
        / f"{name}-{datetime.fromtimestamp(certificate.aos_t_s, UTC):%Y%m%dT%H%M%S}.json"
    )
    write_whole(path, json.dumps(certificate_values(certificate), indent=1) + "\n")
    return path
