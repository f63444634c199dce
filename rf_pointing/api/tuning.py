"""Position loops tuned for a station, for identified models, or for both; their block and file."""

import math
from dataclasses import dataclass, field
from pathlib import Path

from rf_pointing.api.station import Station
from rf_pointing.controllers import LqgDesign
from rf_pointing.controllers.lqg_design import save_lqg_designs
from rf_pointing.core import AXES, MDEG, require_between, require_choice
from rf_pointing.identification import load_models
from rf_pointing.identification.study import KeptModel
from rf_pointing.servo import PlantParams
from rf_pointing.station.antenna.loops import require_stable, require_unmoved
from rf_pointing.station.antenna.tuning import (
    MOST_SENSITIVE,
    USUAL_WIND_M_S,
    AxisModel,
    Law,
    TunedAxis,
    gust_acceleration,
    identified_axis,
    judged,
    plant_axis,
    require_described,
    tuned_axis,
    tuning_lines,
)
from rf_pointing.station.derive.watches import takes_rates

# Largest share of the motion of held-out sequences that a model may miss.
MOST_ERROR = 0.1
LEAST_SENSITIVE, SLOWER = 1.2, 0.85
"""Smallest peak of |S| to tune for, and the step to it where no faster loop is described."""


@dataclass(frozen=True, eq=False)
class Tuning:
    """Loops of one or both axes; `print(tuning)` shows what they reach, `block` what to paste.

    `before` are the loops of the description on the same axes, None without a station.
    `gust_rad_s2_per_m_s` is the wind acceleration of each axis per gust speed.  `remarks` say what
    else a user should know.
    """

    law: str
    wind_m_s: float
    axes: tuple[TunedAxis, ...]
    before: tuple[TunedAxis | None, ...]
    gust_rad_s2_per_m_s: dict[str, float]
    remarks: tuple[str, ...]
    peak_kept: bool
    models: tuple[AxisModel, ...] = field(repr=False)
    names: tuple[str, str] = AXES
    """Names of the axes of the mount, whose parameters are those of azimuth and elevation."""

    def rms_mdeg(self, tuned: TunedAxis) -> float | None:
        """Return the rms beam error of an axis in the wind; None without a station."""
        if tuned.name not in self.gust_rad_s2_per_m_s:
            return None
        return self.gust_rad_s2_per_m_s[tuned.name] * tuned.rms_s2_per_m_s / MDEG

    def block(self, lqg_file: str | Path = "lqg.json") -> str:
        """Return the `tuning:` section of the description; LQG laws are named by their file."""
        others = [f"# {slot} is {name}" for slot, name in zip(AXES, self.names, strict=True) if slot != name]
        lines = [*others, "tuning:"]
        if self.law == "lqg":
            lines += ["  loops.law: lqg", f"  loops.lqg_file: {Path(lqg_file).resolve()}"]
        for tuned in self.axes:
            lines += tuning_lines(tuned, self.peak_kept)
        return "\n".join(lines) + "\n"

    def write(self, folder: str | Path) -> list[Path]:
        """Write block, LQG designs and picture into a folder; return the files.

        Raises ValueError for an LQG law of one axis: the servo takes designs of both.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        block, picture, file = folder / "loops.yaml", folder / "loops.png", folder / "lqg.json"
        files = [block, picture]
        if self.law == "lqg":
            designs = [tuned.law for tuned in self.axes if isinstance(tuned.law, LqgDesign)]
            if len(designs) != len(AXES):
                raise ValueError(f"law=lqg: needs both axes, here is {self.axes[0].name} alone")
            save_lqg_designs(file, designs[0], designs[1])
            files.append(file)
        block.write_text(self.block(file))
        self.draw(picture)
        return files

    def draw(self, path: str | Path) -> None:
        """Draw sensitivity, step and wind response of every axis into a PNG."""
        # Matplotlib is loaded where a picture is wanted.
        from rf_pointing.report.identification_report import draw_loops

        rows = list(zip(self.axes, self.before, self.models, strict=True))
        draw_loops(Path(path), rows, self.wind_m_s, self.gust_rad_s2_per_m_s)

    def __str__(self) -> str:
        heads = ("|S| peak", "worst", "gain dB", "phase deg", "wind mdeg", "lead s")
        lines = [
            f"{self.law} loops, wind {self.wind_m_s:g} m/s; worst: modes 10 %, residues 30 % off, play",
            f"{'':<22}{''.join(f'{head:>11}' for head in heads)}",
        ]
        for before, tuned in zip(self.before, self.axes, strict=True):
            name = self.names[AXES.index(tuned.name)]
            lines += [f"{name + ' before':<22}{self._row(before)}"] if before else []
            lines.append(f"{name + ' tuned':<22}{self._row(tuned)}")
        return "\n".join([*lines, *self.remarks])

    def _row(self, tuned: TunedAxis) -> str:
        rms, margins = self.rms_mdeg(tuned), tuned.margins
        numbers: list[float | None] = [margins.peak_sensitivity, tuned.worst_peak]
        numbers += [margins.gain_margin_db, math.degrees(margins.phase_margin_rad), rms, tuned.lead_s]
        shown = zip(numbers, (2, 2, 1, 0, 3, 3), strict=True)
        cells = ("-" if value is None else f"{value:.{places}f}" for value, places in shown)
        return "".join(f"{cell:>11}" for cell in cells)


def tune(
    station: Station | None = None,
    *,
    models: str | Path | None = None,
    law: str = "pi",
    wind_m_s: float = USUAL_WIND_M_S,
    most_sensitive: float = MOST_SENSITIVE,
) -> Tuning:
    """Return position loops with least beam error in wind within a peak sensitivity.

    Parameters
    ----------
    station : whose plant and wind are tuned for, and whose loops are compared.
    models : models.json of `identify_antenna`, in place of the plant of the description.
    law : pi (with notch, section and feedforward) or lqg.
    wind_m_s : mean wind; its gusts are what the loops reject.
    most_sensitive : largest peak of |S|, kept with the modes 10 % and their residues 30 % off.

    Raises
    ------
    ValueError
        Neither station nor models; a drive that closes its loop itself; a model that misses what
        was measured, with the frequency; an axis without such a loop.

    Examples
    --------
    >>> print(rp.tune(rp.Station("leo_3m7")).block())
    """
    require_choice("law", law, ("pi", "lqg"))
    require_between("wind_m_s", wind_m_s, 0.5, 60.0)
    require_between("most_sensitive", most_sensitive, LEAST_SENSITIVE, 4.0)
    if station is None and models is None:
        raise ValueError("give a station, the models of identify_antenna, or both")
    sets = station.description.sets("antenna_servo", station.band) if station else {}
    if station and station.description.drive["type"] != "simulated" and not takes_rates(station.description.drive):
        raise ValueError(f"{station.name}: its drive takes positions and closes the loop itself")
    kept = load_models(Path(models)) if models is not None else {}
    axes: list[AxisModel] = []
    for number, name in enumerate(AXES):
        if name in kept:
            if kept[name].error > MOST_ERROR:
                raise ValueError(
                    f"{name}: the model misses {100.0 * kept[name].error:.1f} % of the "
                    f"held-out motion, at most {100.0 * MOST_ERROR:g} %"
                )
            bound = (
                plant_axis(sets["plant"], number, kept[name].model.sample_s).most_gain
                if station
                else math.inf
            )  # fmt: skip
            axes.append(identified_axis(name, kept[name].model, bound))
        elif station and not kept:
            axes.append(plant_axis(sets["plant"], number, sets["antenna"].tick_s))
    if not axes:
        raise ValueError(f"models={models}: there is no response of an axis to its own rate")
    plant = sets["plant"] if station else None
    each = [_tuned(axis, law, wind_m_s, most_sensitive, kept.get(axis.name), plant) for axis in axes]
    tuned, slower = [one for one, _ in each], [remark for _, remark in each if remark]
    gusts: dict[str, float] = {}
    before: list[TunedAxis | None] = [None] * len(axes)
    remarks: list[str] = []
    if station:
        gusts = dict(
            zip(AXES, gust_acceleration(sets["plant"], sets["wind"], wind_m_s), strict=True)
        )  # fmt: skip
        before = [judged(axis, getattr(sets["loops"], axis.name), wind_m_s) for axis in axes]
        remarks = _refused_by_servo(tuned, sets["plant"], axes) if kept else []
    return Tuning(
        law, wind_m_s, tuple(tuned), tuple(before), gusts, (*slower, *remarks),
        bool(station) and not remarks, tuple(axes), station.controller.kinematics.axes if station else AXES,
    )  # fmt: skip


def _tuned(
    axis: AxisModel, law: str, wind_m_s: float, most_sensitive: float, model: KeptModel | None,
    plant: PlantParams | None,
) -> tuple[TunedAxis, str]:  # fmt: skip
    """Return the fastest loop that a measured model carries, and why it is not faster, "" if it is.

    The model must describe the axis, and the servo, which knows the `plant` of the description,
    take the loop.  ValueError if the model describes it for no loop.
    """
    fastest, remark = most_sensitive, ""
    while True:
        tuned, last = tuned_axis(axis, law, wind_m_s, fastest), SLOWER * fastest < LEAST_SENSITIVE
        if model is None:
            return tuned, ""
        try:
            require_described(tuned, model.measured_hz, model.measured, model.model)
            why = "".join(_refused_by_servo([tuned], plant, [axis])) if plant else ""
        except ValueError as error:
            if last:
                raise
            why = str(error)
        if last or not why:
            return tuned, remark
        remark = f"{axis.name}: slower than |S| <= {most_sensitive:g} allows; with {fastest:.3g} {why}"
        fastest *= SLOWER


def _refused_by_servo(
    tuned: list[TunedAxis], plant: PlantParams, axes: list[AxisModel]
) -> list[str]:  # fmt: skip
    """Return why the servo, which knows the plant of the description, would refuse these laws."""
    remarks = []
    for one, axis in zip(tuned, axes, strict=True):
        laws: list[Law] = [
            one.law if isinstance(one.law, LqgDesign)
            else one.law.replace(peak_sensitivity=one.margins.peak_sensitivity)
        ] * 2  # fmt: skip
        try:
            require_stable(plant, laws, axis.sample_s, (AXES.index(one.name),))
            require_unmoved(plant, laws, axis.sample_s, (AXES.index(one.name),))
        except ValueError as error:
            modes = ", ".join(f"{hz:.2f}" for hz in sorted(axis.modes_hz.tolist()))
            remarks.append(
                f"the description's plant is not the measured axis (modes at {modes} Hz): {error}"
            )  # fmt: skip
    return remarks
