"""Another band in use: a node takes the numbers that it would begin with there, or none of them."""

from typing import TYPE_CHECKING

from rf_pointing.station.derive.nodes import reference

if TYPE_CHECKING:
    from rf_pointing.ros.station_node import StationNode


def change_band(node: "StationNode", band: str) -> None:
    """Take the numbers of another band; ValueError leaves the node as it was."""
    before = node.band
    try:
        _restate(node, band)
        node.use_band()
    except (ValueError, OSError) as error:
        _restate(node, before)
        node.use_band()
        raise ValueError(f"{band} band: {error}") from error


def _restate(node: "StationNode", band: str) -> None:
    assert node.station is not None
    name, defaults = node.get_name(), reference(node.get_name()).names
    old, new = (node.station.parameters(name, each) for each in (node.band, band))
    differ = [each for each in {**old, **new} if old.get(each) != new.get(each)]
    changed = {each: new.get(each, defaults[each]) for each in differ}
    node.band = band
    node.parameters.restate({**changed, "band": band}, new)
