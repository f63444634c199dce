"""Where the pointing loss of a pass comes from: rows that add up to what was measured.

    e     = e_1 + e_2 + ...        e_k: error with the causes 1 to k-1 switched off, minus that
                                   with k off, too
    loss_k = loss <(e_k . e) (1 - g) / |e|^2> / <1 - g>,       g: power received of that on the axis
    rms_k  = sqrt <|e_k|^2>

Each sample of the lost power is shared by the projections of the causes on the error, so that the
losses add up exactly, and do not depend on the order as far as the station is linear.  A row is
below zero where its cause undoes another.  `api/ledger.py` flies the passes.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core import MDEG, Array, Mode, Pair, require_choice
from rf_pointing.core.pass_outcome import pointing_loss_db, received_power
from rf_pointing.core.whole_file import DATA_BYTES, parse_json, read_whole
from rf_pointing.report.picture_style import figure

LEDGER = "ledger.json"
"""File of the ledger of a pass, with its report."""
PICTURE = "ledger.png"
EPHEMERIS, MODEL, REFRACTION = "ephemeris and time", "model", "refraction"
NOISE, WIND, STEPS = "receiver noise", "wind and structure", "quantisation"
SEARCH, LAG, SCAN, UNEXPLAINED = str(Mode.SEARCH), "servo lag", "scan", "unexplained"
COLOURS = {
    SEARCH: "#cc79a7", EPHEMERIS: "#0072b2", MODEL: "#56b4e9", REFRACTION: "#009e73",
    NOISE: "#e69f00", WIND: "#d55e00", STEPS: "#999933", LAG: "#882255", SCAN: "#44aa99",
    UNEXPLAINED: "#b0b4b8",
}  # fmt: skip
"""Colour of each cause, in the order in which they are switched off."""
# In beamwidths: an error of exactly 0 has no direction to share its loss along.
SMALLEST = 1e-9
NEGLIGIBLE = 0.01
"""Share of the loss below which a part of the bar has no label."""


@dataclass(frozen=True)
class Cause:
    """One row: rms in mdeg and loss in dB of a cause; how it was switched off, or why not."""

    name: str
    rms_mdeg: float
    loss_db: float
    note: str = ""


@dataclass(frozen=True)
class Ledger:
    """The causes of the pointing loss of one pass; `print` shows the table.

    `rms_mdeg` and `loss_db` are the measured totals, of true errors in a simulation, else of sensed
    ones (`source`) less what the sensor's own noise adds to them; "predicted" in a budget.
    `remarks` say what could not be accounted for.
    """

    title: str
    source: str
    seconds: float
    beamwidth_mdeg: float
    rms_mdeg: float
    loss_db: float
    causes: tuple[Cause, ...]
    remarks: tuple[str, ...] = ()

    def cause(self, name: str) -> Cause:
        """Return a row by its name, ValueError for another."""
        rows = {each.name: each for each in self.causes}
        require_choice("cause", name, rows)
        return rows[name]

    @property
    def largest(self) -> Cause:
        """The cause that costs most."""
        return max(self.causes, key=lambda each: (each.loss_db, each.rms_mdeg))

    @property
    def sum_db(self) -> float:
        """Loss in dB that the rows add up to."""
        return sum(each.loss_db for each in self.causes)

    @property
    def short(self) -> str:
        """The largest cause in a few words, for a list of passes."""
        share = self.largest.loss_db / self.loss_db if self.loss_db > 0.0 else 0.0
        return f"{self.largest.name} {self.largest.loss_db:.2f} dB, {100.0 * share:.0f} %"

    def rows(self) -> Iterator[tuple[str, float, float, str]]:
        """Yield name, rms, loss and note of each row, then those of the sum and of the total."""
        for each in self.causes:
            yield each.name, each.rms_mdeg, each.loss_db, each.note
        root = math.sqrt(sum(each.rms_mdeg**2 for each in self.causes))
        yield "root and sum", root, self.sum_db, ""
        yield self.source, self.rms_mdeg, self.loss_db, ""

    def values(self) -> dict[str, Any]:
        """Return everything as plain values; `read` makes the same of them."""
        return asdict(self) | {"causes": [*map(asdict, self.causes)], "remarks": list(self.remarks)}

    def write(self, folder: str | Path) -> list[Path]:
        """Write the table and the bar into a folder, where `report` finds them."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / LEDGER).write_text(json.dumps(self.values(), indent=1) + "\n")
        draw_ledger(self, folder / PICTURE)
        return [folder / LEDGER, folder / PICTURE]

    @classmethod
    def read(cls, folder: str | Path) -> "Ledger | None":
        """Return the ledger of a folder, None without one; ValueError for a damaged file."""
        path = Path(folder) / LEDGER
        if not path.is_file():
            return None
        text = read_whole(path, DATA_BYTES)
        try:
            values = parse_json(text)
            causes = tuple(Cause(**each) for each in values.pop("causes"))
            return cls(**{**values, "causes": causes, "remarks": tuple(values["remarks"])})
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise ValueError(f"{path} is not the ledger of a pass: {error}") from error

    def __str__(self) -> str:
        lines = [
            f"{self.title}: {self.seconds:.0f} s, beam of {self.beamwidth_mdeg:.4g} mdeg",
            *(f"remark: {each}" for each in self.remarks),
            f"{'cause':<20}{'rms, mdeg':>11}{'loss, dB':>10}",
        ]
        for name, rms, loss, note in self.rows():
            lines.append(f"{name:<20}{rms:11.2f}{loss:10.3f}  {note}".rstrip())
        return "\n".join(lines)


def shared(parts: Mapping[str, Array], width_rad: float) -> dict[str, Pair]:
    """Return rms in mdeg and loss in dB of the parts (n, 2) in rad that make up an error."""
    errors = np.asarray(sum(parts.values()))
    radial = np.hypot(*errors.T)
    lost = 1.0 - received_power(radial, width_rad)
    # Finite where nothing is off: there the lost power goes as the square of the error.
    weight = lost / np.maximum(radial, SMALLEST * width_rad) ** 2
    whole = loss_db(errors, width_rad) / max(float(np.sum(lost)), SMALLEST**2)
    return {
        name: (
            float(np.sqrt(np.mean(np.sum(part**2, axis=1)))) / MDEG,
            whole * float(np.sum(weight * np.sum(part * errors, axis=1))),
        )
        for name, part in parts.items()
    }


def loss_db(errors: Array, width_rad: float) -> float:
    """Return the loss of the mean power of errors (n, 2) in rad."""
    return float(pointing_loss_db(np.mean(received_power(np.hypot(*errors.T), width_rad))))


def draw_ledger(ledger: Ledger, path: Path) -> None:
    """Draw the loss as one bar of its causes into a PNG, what causes hide of others below zero."""
    with figure(path, 10.0, 2.6) as drawn:
        axes = drawn.subplots()
        ends, spread = [0.0, 0.0], max(sum(abs(each.loss_db) for each in ledger.causes), 1e-9)
        for each in sorted(ledger.causes, key=lambda cause: -cause.loss_db):
            side = int(each.loss_db < 0.0)
            label = f"{each.name} {each.loss_db:.3f} dB"
            shown = abs(each.loss_db) >= NEGLIGIBLE * spread
            axes.barh(
                0.0, each.loss_db, left=ends[side], height=0.8, color=COLOURS[each.name],
                edgecolor="white", linewidth=1.0, label=label if shown else None,
            )  # fmt: skip
            ends[side] += each.loss_db
        axes.axvline(ledger.loss_db, color="black", lw=1.6)
        axes.annotate(
            f"{ledger.source} {ledger.loss_db:.3f} dB, {ledger.rms_mdeg:.3g} mdeg rms",
            (ledger.loss_db, 0.42), xytext=(-4, 4), textcoords="offset points", ha="right",
        )  # fmt: skip
        axes.set(xlabel="pointing loss, dB", yticks=[], ylim=(-0.5, 0.75))
        axes.grid(axis="y", visible=False)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.35), ncols=4)


def shorts(folder: Path, names: Sequence[str]) -> Mapping[str, str]:
    """Return the largest causes of passes by name, of those whose folder has a ledger."""
    found = {}
    for name in names:
        # A report in the morning is worth more than one file of it.
        with suppress(ValueError, OSError):
            if (ledger := Ledger.read(folder / name)) is not None:
                found[name] = ledger.short
    return found
