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
    return [
        Family("page_viewers", "", "Viewers of the page now.", [({}, viewers)]),
        Family(
            "page_commands",
            "",
            "Commands of viewers since the page started.",
            [({}, commands)],
            "counter",
        ),
        Family(
            "page_refusals",
            "",
            "Requests refused since the page started.",
            [({}, refused)],
            "counter",
        ),
    ]


def _antenna(live: Mapping[str, Any], axes: Sequence[str]) -> list[Family]:
    commanded = [live.get(f"{axis}_deg", math.nan) for axis in AXES]
    encoders = live.get("encoder_deg") or (math.nan, math.nan)
    errors = [there - here for there, here in zip(commanded, encoders, strict=True)]
    rows = (
        (
            "axis_position",
            "degrees",
            "Encoder of an axis; the turn of the cables counts.",
            encoders,
        ),
        ("axis_command", "degrees", "Commanded position of an axis.", commanded),
        ("axis_error", "degrees", "Commanded position of an axis less its encoder.", errors),
        (
            "axis_rate",
            "degrees_per_second",
            "Rate that is commanded to an axis.",
            live.get("rate_deg_s", ()),
        ),
        (
            "axis_rate_limit",
            "degrees_per_second",
            "Largest rate of an axis.",
            live.get("rate_limit_deg_s", ()),
        ),
    )
    return [
        *(
            _gauge(name, unit, words, "axis", dict(zip(axes, values, strict=False)))
            for name, unit, words, values in rows
        ),
        _states("antenna_mode", "Mode of the antenna.", AntennaMode, live.get("antenna", "")),
        Family(
            "fault_latched",
            "",
            "Whether the antenna has a latched fault.",
            [({}, bool(live.get("fault")))],
        ),
    ]


def _tracking(live: Mapping[str, Any]) -> list[Family]:
    found = [
        _states("pointing_mode", "Mode of the pointing controller.", Mode, live.get("tracking", ""))
    ]
    if not live.get("target"):
        return found
    off = [each * live["beamwidth_deg"] for each in live.get("error_beamwidths", ())]
    carrier = live.get("carrier_to_noise_db_hz", 0.0)
    rows: tuple[tuple[str, str, str, float], ...] = (
        (
            "pointing_error",
            "degrees",
            "Angle between target and beam on the sky.",
            math.hypot(*off) if off else math.nan,
        ),
        ("beamwidth", "degrees", "Half-power beamwidth.", live["beamwidth_deg"] or math.nan),
        # 0 is what a station without a receiver reports.
        (
            "carrier_to_noise",
            "db_hz",
            "Carrier to noise density of the target.",
            carrier if carrier > 0.0 else math.nan,
        ),
        (
            "pass_tracked",
            "seconds",
            "Time of this pass in which the target was held.",
            live["seconds_tracked"],
        ),
        ("pass_lost", "seconds", "Time of this pass in which it was not.", live["seconds_lost"]),
        ("pass_loss", "db", "Mean pointing loss of this pass.", live["mean_loss_db"]),
        ("pass_held", "", "Whether the target is held.", float(live["held"])),
    )
    return [
        *found,
        *(Family(name, unit, words, [({}, value)]) for name, unit, words, value in rows),
    ]


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
        Family("alarms_lasting", "", "How many alarms last.", [({}, len(alarms))]),
    ]


def _gauge(name: str, unit: str, words: str, label: str, values: Mapping[str, float]) -> Family:
    return Family(name, unit, words, [({label: key}, value) for key, value in values.items()])


def _states(name: str, words: str, known: Iterable[str], present: str) -> Family:
    """Return a state set: 1 for the present one; a registered tracker's may be one more."""
    states = dict.fromkeys([*map(str, known), *([present] if present else [])], 0.0) | (
        {present: 1.0} if present else {}
    )
    return Family(
        name,
        "",
        words,
        [({PREFIX + name: key}, value) for key, value in states.items()],
        "stateset",
    )


def _escaped(text: str) -> str:
    return re.sub(r'[\\"\n]', lambda found: _ESCAPED[found[0]], text)
