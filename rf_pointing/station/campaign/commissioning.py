"""The first model of a simulated station: that of the simulated antenna, wherever it stands.

The node refuses a model of another station or band, as it must.  The simulated antenna is the same
one everywhere, so what was measured when it was commissioned is written down once more, under the
station and band that are asked for.
"""

import dataclasses
from pathlib import Path

from rf_pointing.calibration import read_model, write_model

__all__ = ["commissioning_model"]

FILES = {"Ka": "bias_model_dss13_ka.yaml"}
"""Bands for which the common model of the antenna is not good enough."""
COMMON = "bias_model_dss13.yaml"


def commissioning_model(config: Path, station: str, band: str, folder: Path) -> Path:
    """Return the model file in `config` for a station and band, else a copy in `folder`."""
    source = config / FILES.get(band, COMMON)
    file = read_model(source)
    if (file.station, file.band) == (station, band):
        return source
    copy = folder / "commissioning_model.yaml"
    write_model(copy, dataclasses.replace(file, name=f"{file.name}-{band}", station=station, band=band))
    return copy
