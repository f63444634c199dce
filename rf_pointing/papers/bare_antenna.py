"""Drives, structure and wind of an antenna without control unit and mount, for the time loop
`simulation.closed_loop.ticks`.
"""

from collections.abc import Callable, Sequence

from rf_pointing.core.types import Array
from rf_pointing.servo import AntennaPlant, Wind
from rf_pointing.station.antenna.loops import AnyLaw, law_rates

Command = tuple[Array, Array, Array]
"""Position (rad), velocity (rad/s) and acceleration (rad/s^2) of azimuth and elevation, each (2,).
"""


class BareAntenna:
    """Moves under the rate commands (2,) that `rates` returns.

    `rates(k, encoder_rad)` is called once a tick with the encoder angles (2,) at its beginning; the
    wind meets the dish at the attitude (azimuth, elevation) that `attitude(k)` returns, at the
    encoder angles without it.
    """

    def __init__(
        self,
        plant: AntennaPlant,
        wind: Wind,
        tick_s: float,
        rates: Callable[[int, Array], Sequence[float] | Array],
        attitude: Callable[[int], Sequence[float]] | None = None,
    ) -> None:
        self.plant = plant
        self._wind, self._tick_s, self._rates, self._attitude = wind, tick_s, rates, attitude

    def step(self, k: int) -> Sequence[float] | Array:
        """Move through tick `k` and return the rate commands (2,) in force during it."""
        encoder_rad = self.plant.encoder_rad
        rates = self._rates(k, encoder_rad)
        azimuth_rad, elevation_rad = (
            encoder_rad.tolist() if self._attitude is None else self._attitude(k)
        )
        self.plant.step(
            rates, self._wind.step(self._tick_s, azimuth_rad, elevation_rad), self._tick_s
        )
        return rates


class LawsOnCommand:
    """Position laws of azimuth and elevation that follow what `command(k)` returns: rate commands
    for `BareAntenna`.
    """

    def __init__(
        self, laws: Sequence[AnyLaw], tick_s: float, command: Callable[[int], Command]
    ) -> None:
        self._laws, self._tick_s, self._command = laws, tick_s, command

    def __call__(self, k: int, encoder_rad: Array) -> list[float]:
        """Return the rate commands of tick `k`."""
        command = [part.tolist() for part in self._command(k)]
        return law_rates(self._laws, command, encoder_rad.tolist(), self._tick_s)

    def settle(self, plant: AntennaPlant, position_rad: Array, velocity_rad_s: Array) -> None:
        """Put drives and laws into steady motion (2,) through this position (2,), as after a long
        approach.
        """
        state = plant.state
        state.x[2:4] = velocity_rad_s
        plant.state = state
        rows = zip(self._laws, position_rad.tolist(), velocity_rad_s.tolist(), strict=True)
        for law, position, velocity in rows:
            law.reset(position, velocity, position, velocity)
