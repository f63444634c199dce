"""The values of the page as OpenMetrics 1.0, for Prometheus and others that read its format.

`board_metrics` makes metric families of the values that the page shows, `exposition` writes them.
Names end in their unit.  A source that has been silent for `STALE_S` gives no samples: a gap is
seen, a line that stays as it was is not.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rf_pointing.core import AXES
from rf_pointing.core.modes import Mode
from rf_pointing.station.antenna.modes import AntennaMode

CONTENT_TYPE = "application/openmetrics-text; version=1.0.0; charset=utf-8"
STALE_S = 10.0
PREFIX = "rf_pointing_"
_ESCAPED = {"\\": r"\\", '"': r"\"", "\n": r"\n"}

Sample = tuple[Mapping[str, str], float]


@dataclass(frozen=True)
class Family:
    """One metric: its name without prefix, unit ("" for none), help, samples and type."""

    name: str
    unit: str
    help: str
    samples: Sequence[Sample]
    kind: str = "gauge"

    def lines(self) -> Iterable[str]:
        """Yield its lines; nothing for a family without a finite sample."""
        finite = [(labels, value) for labels, value in self.samples if math.isfinite(value)]
        if not finite:
            return
        name = f"{PREFIX}{self.name}{f'_{self.unit}' if self.unit else ''}"
        yield f"# TYPE {name} {self.kind}"
        if self.unit:
            yield f"# UNIT {name} {self.unit}"
        yield f"# HELP {name} {_escaped(self.help)}"
        suffix = {"counter": "_total", "info": "_info"}.get(self.kind, "")
        for labels, value in finite:
            shown = ",".join(f'{key}="{_escaped(text)}"' for key, text in labels.items())
            yield f"{name}{suffix}{f'{{{shown}}}' if shown else ''} {float(value)!r}"


def exposition(families: Iterable[Family]) -> str:
    """Return the text of a scrape."""
    return "".join(f"{line}\n" for family in families for line in family.lines()) + "# EOF\n"


def board_metrics(
    live: Mapping[str, Any], age_s: Mapping[str, float], kept: Mapping[str, Any], nodes: Sequence[Mapping[str, Any]],
    axes: Sequence[str] = AXES,
) -> list[Family]:  # fmt: skip
    """Return the families of a station.

    Parameters
    ----------
    axes : names of the lower and the upper axis.
    live, kept, nodes : sections of the page (`station/clients/board.py`).
    age_s : age of the newest message of antenna, tracking, target and executive, in s.
    """
    fresh = {name for name, age in age_s.items() if age <= STALE_S}
    station = {key: str(kept["station"].get(key, "")) for key in ("name", "band")}
    families = [
        Family("station", "", "Station and band in use.", [(station, 1.0)], "info"),
        _gauge("source_age", "seconds", "Age of the newest message of a source.", "source", age_s),
        _gauge("node_level", "", "Worst check of a node: 0 ok, 1 warning, 2 error or silent.", "node", {
            node["name"]: 2.0 if node["silent_s"] else max([0, *(check[1] for check in node["checks"])]) for node in nodes
        }),
    ]  # fmt: skip
    if "antenna" in fresh:
        families += _antenna(live, axes)
    if "tracking" in fresh:
        families += _tracking(live)
    if "target" in fresh:
        age_h = live.get("sky_target", {}).get("age_h")
        age = [({}, 3600.0 * age_h)] if age_h is not None else []
        families.append(
            Family("elements_age", "seconds", "Age of the elements of the selected target.", age)
        )
    if "executive" in fresh:
        states = live.get("schedule_states", {})
        families.append(
            _gauge("schedule_passes", "", "Passes of the schedule by their state.", "state", states)
        )
        families += _alarms(kept["executive"]["alarms"])
    else:
        # Without an executive station_alarms raises them, and shows them as a check of its own.
        checks = {
            (node["name"], each[0]): each
            for node in nodes
            if not node["silent_s"]
            for each in node["checks"]
        }
        if own := checks.get(("station_alarms", "alarms")):
            row = {"name": "station_alarms", "level": own[1], "acknowledged": False}
            families += _alarms([row] if own[1] else [])
    return families


def labelled(of_antennas: Mapping[str, Sequence[Family]]) -> list[Family]:
    """Return the families of several antennas as one each, with the label `antenna`."""
    merged = dict[str, Family]()
    for antenna, families in of_antennas.items():
        for each in families:
            samples = [({"antenna": antenna, **labels}, value) for labels, value in each.samples]
            before = merged[each.name].samples if each.name in merged else ()
            merged[each.name] = replace(each, samples=[*before, *samples])
    return list(merged.values())


def page_metrics(viewers: int, commands: int, refused: int) -> list[Family]:
    """Return what the page counts of itself."""
    counts = (
        ("page_commands", "Commands of viewers since the page started.", commands),
        ("page_refusals", "Requests refused since the page started.", refused),
    )
    return [
        _value("page_viewers", "", "Viewers of the page now.", viewers),
        *(_value(name, "", words, count, "counter") for name, words, count in counts),
    ]


def _antenna(live: Mapping[str, Any], axes: Sequence[str]) -> list[Family]:
    commanded = [live.get(f"{axis}_deg", math.nan) for axis in AXES]
    encoders = live.get("encoder_deg") or (math.nan, math.nan)
    errors = [there - here for there, here in zip(commanded, encoders, strict=True)]
    rates, limits = (live.get(name, ()) for name in ("rate_deg_s", "rate_limit_deg_s"))
    deg, deg_s = "degrees", "degrees_per_second"
    rows = (
        ("axis_position", deg, "Encoder of an axis; the turn of the cables counts.", encoders),
        ("axis_command", deg, "Commanded position of an axis.", commanded),
        ("axis_error", deg, "Commanded position of an axis less its encoder.", errors),
        ("axis_rate", deg_s, "Rate that is commanded to an axis.", rates),
        ("axis_rate_limit", deg_s, "Largest rate of an axis.", limits),
    )
    fault = bool(live.get("fault"))
    return [
        *(
            _gauge(name, unit, words, "axis", dict(zip(axes, values, strict=False)))
            for name, unit, words, values in rows
        ),
        _states("antenna_mode", "Mode of the antenna.", AntennaMode, live.get("antenna", "")),
        _value("fault_latched", "", "Whether the antenna has a latched fault.", fault),
    ]


def _tracking(live: Mapping[str, Any]) -> list[Family]:
    mode = live.get("tracking", "")
    found = [_states("pointing_mode", "Mode of the pointing controller.", Mode, mode)]
    if not live.get("target"):
        return found
    off = [each * live["beamwidth_deg"] for each in live.get("error_beamwidths", ())]
    error_deg = math.hypot(*off) if off else math.nan
    # 0 is what a station without a receiver reports.
    level_db_hz = max(live.get("carrier_to_noise_db_hz", 0.0), 0.0) or math.nan
    held_s, lost_s = live["seconds_tracked"], live["seconds_lost"]
    rows: tuple[tuple[str, str, str, float], ...] = (
        ("pointing_error", "degrees", "Angle between target and beam on the sky.", error_deg),
        ("beamwidth", "degrees", "Half-power beamwidth.", live["beamwidth_deg"] or math.nan),
        ("carrier_to_noise", "db_hz", "Carrier to noise density of the target.", level_db_hz),
        ("pass_tracked", "seconds", "Time of this pass in which the target was held.", held_s),
        ("pass_lost", "seconds", "Time of this pass in which it was not.", lost_s),
        ("pass_loss", "db", "Mean pointing loss of this pass.", live["mean_loss_db"]),
        ("pass_held", "", "Whether the target is held.", float(live["held"])),
    )
    return found + [_value(*row) for row in rows]


def _alarms(rows: Sequence[Mapping[str, Any]]) -> list[Family]:
    alarms = [
        (
            {"alarm": each["name"], "level": ("ok", "warning", "error")[min(each["level"], 2)]},
            1.0 + each["acknowledged"],
        )
        for each in rows
    ]
    return [
        Family("alarm_lasts", "", "Alarms that last: 1 not acknowledged, 2 acknowledged.", alarms),
        _value("alarms_lasting", "", "How many alarms last.", len(alarms)),
    ]


def _gauge(name: str, unit: str, words: str, label: str, values: Mapping[str, float]) -> Family:
    return Family(name, unit, words, [({label: key}, value) for key, value in values.items()])


def _value(name: str, unit: str, words: str, value: float, kind: str = "gauge") -> Family:
    """Return a metric of one sample without labels."""
    return Family(name, unit, words, [({}, value)], kind)


def _states(name: str, words: str, known: Iterable[str], present: str) -> Family:
    """Return a state set: 1 for the present one; a registered tracker's may be one more."""
    states = dict.fromkeys(map(str, known), 0.0) | ({present: 1.0} if present else {})
    return replace(_gauge(name, "", words, PREFIX + name, states), kind="stateset")


def _escaped(text: str) -> str:
    return re.sub(r'[\\"\n]', lambda found: _ESCAPED[found[0]], text)
