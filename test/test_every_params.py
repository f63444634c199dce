"""Every parameter set of the package: kept on the way to degrees and back, or refused by name and bound."""

import dataclasses
import importlib
import math
import pkgutil
import re
from collections.abc import Iterator
from typing import Any, get_args, get_origin, get_type_hints

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import rf_pointing
from rf_pointing.calibration.pass_errors import PassPriors
from rf_pointing.core import Params, leaves, to_degrees, with_leaves
from rf_pointing.orbit.study import Tracking
from rf_pointing.servo import dss13_plant
from rf_pointing.tracking.monopulse import MonopulseCalibration

ROS = {"commands", "live", "nodes", "ros", "web"}
UNBOUNDED = 1e6


def every_set() -> dict[str, type[Params]]:
    """Return the sets of every module that needs no ROS, by their full names."""
    for module in pkgutil.walk_packages(rf_pointing.__path__, "rf_pointing."):
        if not ROS & set(module.name.split(".")) and not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    found = {f"{kind.__module__}.{kind.__qualname__}": kind for kind in below(Params)}
    return {name.removeprefix("rf_pointing."): kind for name, kind in found.items() if name.startswith("rf_pointing.")}


def below(kind: type[Any]) -> Iterator[type[Any]]:
    for one in kind.__subclasses__():
        yield from (one, *below(one))


SETS = every_set()
# Sets whose fields depend on each other so much that the middle of each range is refused.
KNOWN: dict[str, Params] = {
    type(each).__name__: each
    for each in (
        dss13_plant(), dss13_plant().azimuth, PassPriors(along_track_m=5.0),
        Tracking(angle_sigma_rad=5e-5), MonopulseCalibration(response_real=(1.0, 0.0, 0.0, 1.0), response_imaginary=(0.0,) * 4),
    )
}  # fmt: skip
IN_OTHER_WORDS = ("pass priors are all zero", "does not separate cross-elevation", "principal moments")
"""Refusals of values together that name no field: they are in the words of the domain."""


def usual(kind: type[Params]) -> Params:
    """Return the default of a set, with the middle of its range where a field has none."""
    if kind.__name__ in KNOWN:
        return KNOWN[kind.__name__]
    middle: dict[str, Any] = {}
    for item in dataclasses.fields(kind):
        if item.default is dataclasses.MISSING:
            low, high = bounds(item)
            count = len(get_args(item.type))
            middle[item.name] = "x" if item.type is str else (0.5 * (low + high),) * count or 0.5 * (low + high)
    return kind(**middle)


def bounds(item: "dataclasses.Field[Any]") -> tuple[float, float]:
    low, high = item.metadata["low"], item.metadata["high"]
    return (-UNBOUNDED if low is None else low), (UNBOUNDED if high is None else high)


def values(kind: Any, item: "dataclasses.Field[Any]") -> st.SearchStrategy[Any]:
    """Return values of a field that its declaration allows."""
    if item.metadata["choices"]:
        return st.sampled_from(sorted(item.metadata["choices"]))
    if get_origin(kind) is tuple:
        kinds = get_args(kind)
        inner = values(kinds[0], item)
        return st.lists(inner, max_size=4).map(tuple) if Ellipsis in kinds else st.tuples(*[inner] * len(kinds))
    low, high = bounds(item)
    if kind is float:
        # Radians that are not tiny: their degrees are exact to a rounding error.
        return st.floats(low, high).map(lambda value: value if abs(value) > 1e-300 else max(low, min(0.0, high)))
    if kind is int:
        return st.integers(math.ceil(low), math.floor(high))
    return st.booleans() if kind is bool else st.text(max_size=8) if kind is str else st.just(usual(kind))


@pytest.mark.parametrize("name", SETS)
@settings(max_examples=10, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_what_is_accepted_comes_back_from_degrees_and_the_rest_is_named(name: str, data: st.DataObject) -> None:
    kind, hints = SETS[name], get_type_hints(SETS[name])
    fields = {item.name: item for item in dataclasses.fields(kind)}
    changed = data.draw(st.lists(st.sampled_from(sorted(fields)), min_size=1, max_size=3, unique=True))
    given_values = {each: data.draw(values(hints[each], fields[each])) for each in changed}
    try:
        made = usual(kind).replace(**given_values)
    except ValueError:
        # Each value alone is allowed: the fields that contradict each other are named, in either unit of angles.
        with pytest.raises(ValueError, match="|".join((*fields, *IN_OTHER_WORDS)).replace("_rad", "_(rad|deg)")):
            usual(kind).replace(**given_values)
        return
    edge = {key: value for key, (_, value) in leaves(made).items()}
    back = {key: value for key, (_, value) in leaves(with_leaves(made, edge)).items()}
    for key, value in edge.items():
        assert back[key] == (pytest.approx(value, rel=1e-13) if re.search(r"_deg(_s\d?)?$", key) else value)
    assert kind.from_mapping({each: getattr(made, each) for each in fields}) == made


@pytest.mark.parametrize("name", SETS)
def test_a_number_beyond_a_bound_is_refused_with_name_and_bound_in_radians_and_degrees(name: str) -> None:
    kind, start = SETS[name], usual(SETS[name])
    for item in dataclasses.fields(kind):
        if item.type not in (int, float):
            continue
        for sign, word, bound in ((-1, ">=", item.metadata["low"]), (1, "<=", item.metadata["high"])):
            if bound is not None:
                beyond = bound + sign * (1 if item.type is int else max(1e-3, 1e-3 * abs(bound)))
                with pytest.raises(ValueError, match=f"^{re.escape(f'{item.name}={beyond} must be {word} {bound}')}$"):
                    start.replace(**{item.name: beyond})
                edge, value = to_degrees(item.name, beyond)
                with pytest.raises(ValueError, match=f"^{re.escape(f'{edge}={value} must be {word} ')}"):
                    with_leaves(start, {edge: value})
        with pytest.raises(ValueError, match=f"^{item.name}=nan must be (finite|a whole number)$"):
            start.replace(**{item.name: math.nan})
