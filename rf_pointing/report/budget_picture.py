"""Picture of a link budget: the noise by its parts, G/T and C/N0."""

from collections.abc import Mapping
from pathlib import Path

from rf_pointing.core.types import Array
from rf_pointing.report.picture_style import AXIS_COLOURS, figure
from rf_pointing.report.plan_picture import COLOURS


def draw_budget(columns: Mapping[str, Array], minutes: Array, title: str, path: Path) -> None:
    """Write the picture of a link budget (`api/link_budget.py`) to `path`.

    It is drawn over the `minutes` of a pass, over elevation where there are none.
    """
    x, name = (minutes, "min after AOS") if len(minutes) else (columns["elevation_deg"], "elevation, deg")
    with figure(path, 9.0, 6.4) as drawn:
        noise, level = drawn.subplots(2, 1, sharex=True)
        parts = [key for key in columns if key.endswith("_k") and not key.startswith(("system", "g_over"))]
        noise.stackplot(x, *(columns[key] for key in parts), labels=[key[:-2] for key in parts], colors=COLOURS)
        noise.set_ylabel("noise temperature, K")
        noise.legend(loc="upper right", ncols=4)
        noise.set_title(title)
        level.plot(x, columns["carrier_to_noise_db_hz"], color=AXIS_COLOURS[0], label="C/N0, dB-Hz")
        merit = level.twinx()
        merit.plot(x, columns["g_over_t_db_k"], color=AXIS_COLOURS[1], label="G/T, dB/K")
        merit.set_ylabel("G/T, dB/K", color=AXIS_COLOURS[1])
        level.set_ylabel("C/N0, dB-Hz", color=AXIS_COLOURS[0])
        level.set_xlabel(name)
