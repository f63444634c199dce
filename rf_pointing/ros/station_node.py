"""A managed node of one antenna: it begins with the numbers of the station description.

Every node publishes, latched on `station_in_use`, which description it runs on.  Nodes with
different limits or another horizon are how antennas get damaged, so the pointing controller refuses
a pass while a node of its namespace differs.  The band in use may change between two passes: every
node takes that of the controller, with the numbers that it would begin with.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rf_pointing_msgs.msg import StationInUse

from rf_pointing.core import Params, parameter
from rf_pointing.ros.graph import BAND_IN_USE, STATION_IN_USE
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import IN_USE, LATCHED
from rf_pointing.station.derive.nodes import NODES, reference
from rf_pointing.station.description import StationDescription, owner, read_station, shipped_stations


@dataclass(frozen=True, kw_only=True)
class StationParams(Params):
    """Which antenna a node belongs to."""

    station: str = parameter("", "station description: a YAML file, or a shipped name")
    band: str = parameter("", "band in use; empty: the description's default")


class StationNode(ManagedNode):
    """A node whose parameters the station description gives; `station` is None if it is refused.

    Its parameter sets are those of `derive/nodes.py`; `live` are those that may change while the
    node is configured: True for a whole set, or names of its fields; `defaults` are in place of the
    table's.  It checks the file and its own numbers; one that `CHECKS_EVERY_NODE` those of the
    others, too.
    """

    CHECKS_EVERY_NODE = False
    LEADS_BAND = False
    """Whether the other nodes take the band of this one, which publishes it on `band_in_use`."""

    def __init__(
        self, name: str, live: Mapping[str, bool | Collection[str]] = MappingProxyType({}),
        defaults: Mapping[str, Params] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        super().__init__(name)
        self.parameters.declare("", StationParams(), group="description")
        self.station: StationDescription | None = None
        self._led_to = ""
        choice: StationParams = self.parameters.value("description")
        try:
            if not choice.station:
                known = ", ".join(shipped_stations())
                raise ValueError(f"station='' must name a station description: your YAML file, or one of {known}")
            station = read_station(
                choice.station, tuple(each for each in NODES if self.CHECKS_EVERY_NODE or each == name)
            )
            station.require_mount(name)
            self.band = choice.band or station.default_band
            values = station.parameters(name, self.band)
        except ValueError as error:
            self.parameters.reasons += str(error).splitlines()
        else:
            self.station = station
            self.parameters.take_station(values, partial(owner, name))
        usual = reference(name)
        for prefix, params in {**usual.defaults, **defaults}.items():
            self.parameters.declare(prefix, params, live=live.get(prefix, False))
        for group, params in usual.root.items():
            self.parameters.declare("", params, live=live.get(group, False), group=group)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        result = super().on_configure(state)
        if result == TransitionCallbackReturn.SUCCESS and self.station is not None:
            self._in_use = [self.publisher(StationInUse, STATION_IN_USE, IN_USE)]
            if self.LEADS_BAND:
                self._in_use.append(self.publisher(StationInUse, BAND_IN_USE, LATCHED))
            if not self.LEADS_BAND or self.quiet:
                self.listen(StationInUse, BAND_IN_USE, self._on_band, LATCHED)
            self.announce()
        return result

    def announce(self) -> StationInUse:
        """Publish the description and band that this node runs on; return the message."""
        assert self.station is not None
        name, station = self.get_fully_qualified_name(), self.station
        message = StationInUse(node=name, station=station.name, band=self.band, digest=station.digest)
        message.header.stamp = self.get_clock().now().to_msg()
        for publisher in () if self.quiet else self._in_use:
            publisher.publish(message)
        return message

    # The band

    def use_band(self) -> None:
        """Make anew what was made of the parameters, which are now those of another band."""

    def change_band(self, band: str) -> StationInUse:
        """Take the numbers of another band; return what is published of it.

        ValueError leaves the node as it was.
        """
        # Imported when it is needed: most stations have one band.
        from rf_pointing.ros.band_change import change_band

        change_band(self, band)
        return self.announce()

    def follow_band(self) -> None:
        """Take the band of the pointing controller, if it is another one."""
        band, self._led_to = self._led_to, ""
        if band not in ("", self.band):
            try:
                self.change_band(band)
            except ValueError as error:
                self.log_once("band not changed", str(error), error=True)

    def _on_band(self, message: StationInUse) -> None:
        # A controller on another description finds this node in its census, and moves nothing.
        if self.station is not None and message.digest == self.station.digest:
            self._led_to = message.band
            self.follow_band()
