"""A station as an object: its description, one of its bands, and what it can do."""

import importlib
import math
from functools import cached_property
from pathlib import Path
from typing import Any

from rf_pointing.calibration import BiasModel, read_model
from rf_pointing.ephemeris import Site
from rf_pointing.planning import AxisLimits
from rf_pointing.station.description import DEFAULT_STATION, StationDescription, read_station
from rf_pointing.station.parameters import antenna_params, controller_params
from rf_pointing.station.pointing.certificates import PlanningRules
from rf_pointing.station.pointing.params import ControllerParams


class Station:
    """One antenna as its description states it, in one band.

    Parameters
    ----------
    station : your description file (YAML), or the name of a shipped one: dss13 (default), leo_3m7,
        rotator_2m, vhf_uhf_yagi.
    band : one of its bands; its default band if None.
    model : bias model in place of the station's: a file, or `BiasModel.zero()` for none.

    Raises
    ------
    ValueError
        The description has problems (all are listed with file and line), or not this band.

    Examples
    --------
    >>> station = rp.Station("leo_3m7")
    >>> station.band, station.sensors
    ('X', ('conscan', 'steptrack'))
    """

    def __init__(
        self,
        station: str | Path | StationDescription = DEFAULT_STATION,
        band: str | None = None,
        *,
        model: BiasModel | str | Path | None = None,
    ) -> None:
        self.description = station if isinstance(station, StationDescription) else read_station(station)
        self.band = self.description.default_band if band is None else band
        if self.band not in self.bands:
            raise ValueError(f"band={self.band!r} of {self.name} must be one of {', '.join(self.bands)}")
        self._model = model

    def __repr__(self) -> str:
        return f"Station({self.name!r}, band={self.band!r})"

    @property
    def name(self) -> str:
        """Name of the station; models and observations belong to it."""
        return self.description.name

    @property
    def bands(self) -> tuple[str, ...]:
        """Names of its bands, in the order of the file."""
        return self.description.bands

    @property
    def site(self) -> Site:
        """Where the antenna stands."""
        return self.description.site

    @property
    def simulated(self) -> bool:
        """Whether its drive is simulated; any other moves a device in real time."""
        return self.description.simulated

    @property
    def sensors(self) -> tuple[str, ...]:
        """What the band can track with, the default first; empty for program track alone."""
        return self.description.sensors(self.band)

    @cached_property
    def controller(self) -> ControllerParams:
        """Parameter sets of the pointing controller, in radians."""
        return controller_params(self.description, self.band)

    @property
    def limits(self) -> AxisLimits:
        """Travel of the axes, in radians."""
        return self.controller.limits

    @property
    def beamwidth_deg(self) -> float:
        """Half-power beamwidth of the band."""
        return math.degrees(self.controller.machine.half_power_beamwidth_rad)

    @cached_property
    def model(self) -> BiasModel:
        """The bias model in force: the one given, else the station's, else a perfect mount."""
        chosen = self.description.bias_model_file(self.band) if self._model is None else self._model
        if isinstance(chosen, BiasModel):
            return chosen
        return read_model(chosen).model if chosen else BiasModel.zero()

    @cached_property
    def rules(self) -> PlanningRules:
        """The antenna that passes are planned for: its errors, axes, mask and safety gate."""
        sets = self.controller
        return PlanningRules(
            model=self.model, machine=sets.machine, limits=sets.limits, mask=sets.mask, gate=sets.gate,
            lag_averaging_s=sets.pointing.lag_averaging_s,
        )  # fmt: skip

    @cached_property
    def start_rad(self) -> tuple[float, float]:
        """Azimuth and elevation at which the antenna is taken to stand at first."""
        return antenna_params(self.description, self.band).antenna.start_rad

    @cached_property
    def lowest_rad(self) -> float:
        """Elevation at which passes begin and end unless one is given; the mask may be above it."""
        values = self.description.parameters("ephemeris_publisher", self.band)
        return math.radians(values["publisher.mask_deg"])

    def track(self, *arguments: Any, **options: Any) -> Any:
        """Track a pass with the live graph of this station (ROS): see `rf_pointing.api.live`."""
        # Not at the top: the rest of the front door does without ROS.
        live = importlib.import_module("rf_pointing.api.live")
        return live.track(self, *arguments, **options)
