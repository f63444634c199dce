"""Executable `identify_antenna`: shake the antenna axis by axis; leave models and pictures.

Needs an active antenna that is holding (action `identify`, topic manual_rate); with --simulated it
starts one of its own.  Exit code 0: models were made; 1: the experiment ended early or the data do
not carry a model; 2: it could not be started.
"""

import argparse
import math
import sys
from functools import partial
from pathlib import Path
from typing import Any

from rf_pointing.api import live
from rf_pointing.api.requests import IDLE_DEG_S, IdentifyRequest
from rf_pointing.commands.options import add_options, between, command, ending_with_reason, requested
from rf_pointing.core import AXES
from rf_pointing.identification import ExcitationParams

USUAL, QUICK = (8, 4, ExcitationParams().samples), (6, 2, 2048)
"""Sequences of an axis, those that are held out, and samples of each: 22 and 4 min at 50 Hz."""


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    usual = ExcitationParams()
    parser = command("identify_antenna", "Identify the antenna from its own motion.")
    add = parser.add_argument
    add("--axes", nargs="+", choices=AXES, default=list(AXES), help="axes to drive, the lower one as azimuth (both)")
    add("--quick", action="store_true", help=f"4 min an axis: {QUICK[0]} sequences of {QUICK[2]}, {QUICK[1]} held out")
    add("--sequences", type=int, help=f"sequences per axis (default: {USUAL[0]})")
    add("--held-out", type=int, help=f"the last of them, kept for the check (default: {USUAL[1]})")
    add("--samples", type=int, help=f"samples per sequence (default: {USUAL[2]})")
    add("--kind", choices=("white", "multisine"), default=usual.kind, help="(default: white)")
    for name in ("mean", "rms", "peak"):
        value = math.degrees(getattr(usual, f"{name}_rad_s"))
        add(f"--{name}-deg-s", type=float, default=value, help=f"{name} of the rate ({value:.3f})")
    add("--idle-deg-s", type=float, default=IDLE_DEG_S, help=f"rate of the other axis (default: {IDLE_DEG_S})")
    add_options(parser, "seed", seed={"default": 1, "help": "seed of the random input (default: 1)"})
    add("--tick", type=between(0.001, 0.1), default=usual.sample_s, help="control period in s (default: 0.02)")
    add_options(
        parser, "namespace station band output params-file",
        output={"default": Path("runs/identification"), "help": "folder of the results"},
        params_file="parameter file of a simulated antenna, may be repeated",
    )  # fmt: skip
    add("--simulated", action="store_true", help="start a simulated antenna, in wind of 0.3 m/s")
    return parser


def request_with(
    *, tick: float, idle_deg_s: float, kind: str, mean_deg_s: float, rms_deg_s: float, peak_deg_s: float, quick: bool,
    sequences: int | None, held_out: int | None, samples: int | None, **others: Any,
) -> IdentifyRequest:  # fmt: skip
    """Return the request of the options; the band ends at half of the control rate."""
    known = zip((sequences, held_out, samples), QUICK if quick else USUAL, strict=True)
    sequences, held_out, samples = (usual if one is None else one for one, usual in known)
    excitation = ExcitationParams(
        kind=kind, samples=samples, sample_s=tick, high_hz=min(ExcitationParams().high_hz, 0.5 / tick),
        mean_rad_s=math.radians(mean_deg_s), rms_rad_s=math.radians(rms_deg_s),
        peak_rad_s=math.radians(peak_deg_s), idle_rate_rad_s=math.radians(idle_deg_s),
    )  # fmt: skip
    return IdentifyRequest(excitation=excitation, sequences=sequences, held_out=held_out, **others)


request_of = partial(requested, arguments, request_with)
"""Returns the request of a command line; ValueError with the reason where it cannot be."""


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing identify_antenna`."""
    with ending_with_reason("identify_antenna"):
        request = request_of(argv)
        request.output.mkdir(parents=True, exist_ok=True)
    found = live.identify(request)
    if found.table:
        print(found.table)
    sys.exit(found.code)
