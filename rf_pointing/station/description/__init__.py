"""The station description: one YAML file that every node, command and simulation obeys.

`read_station` reads it, `StationDescription.parameters` gives the parameters of a node, and
`owner` says which key of the description gives one.
"""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.station.description.description import (
        DEFAULT_STATION,
        STATIONS,
        StationDescription,
        owner,
        read_station,
        same_value,
        shipped_stations,
        station_from,
    )
    from rf_pointing.station.description.reading import StationError

__getattr__ = lazily(__name__, __file__)
