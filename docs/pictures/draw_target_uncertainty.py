#!/usr/bin/env python3
"""Draw what is known about a target: with age, on a pass, in a search, and after passes.

    scripts/run-python docs/pictures/draw_target_uncertainty.py

Nothing is flown but two passes for what they teach; two minutes of processor time.
"""

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

import rf_pointing as rp
from rf_pointing.core import Mode
from rf_pointing.ephemeris import ElementUncertainty
from rf_pointing.ephemeris.learned_times import LearnedTimes
from rf_pointing.simulation import StationSetup
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.scan_patterns import ScanPatterns, Scans
from rf_pointing.tracking import SkyMotion, TrackPath, TrimFilter, prior_of

FOLDER = Path(__file__).parent
DAY_S, SPEED_M_S, AHEAD_S = 86400.0, 7500.0, 4.0
STYLE: Any = {"font.size": 10.0, "axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#888888"}
BLUE, ORANGE, GREEN, GREY = "#0072b2", "#e69f00", "#009e73", "#8a8a8a"


def picture(name: str, x: str, y: str) -> tuple[Figure, Any]:
    figure = Figure(figsize=(7.0, 3.4), layout="constrained")
    axes = figure.subplots()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(name, loc="left", fontsize=10.0)
    return figure, axes


def age() -> Figure:
    """Seconds along the track against the age of the elements, and after a manoeuvre."""
    figure, axes = picture("age of the elements", "age, days", "sigma along the track, s")
    days = np.linspace(0.0, 14.0, 200)
    for label, law, colour in (
        ("mean elements", ElementUncertainty(), BLUE),
        ("after a manoeuvre of 0.05 m/s", ElementUncertainty(manoeuvre_m_s=0.05), ORANGE),
    ):
        axes.plot(days, [law.sigmas_m(day * DAY_S)[0] / SPEED_M_S for day in days], color=colour, label=label)
    axes.axhline(0.15, color=GREY, lw=0.8, ls=":", label="what the filter takes for usual")
    axes.set_ylim(0.0, 12.0)
    axes.legend(frameon=False)
    return figure


def promised() -> Figure:
    """Seconds that nine passes of ten hold, with and without a sensor."""
    figure, axes = picture("one pass of the 3.7-m dish at X band", "sigma along the track, s", "held with 90 %, s")
    station = rp.Station("leo_3m7", "X")
    one = station.passes(rp.elements("CBERS 2"), days=2, min_peak_deg=40.0)[0]
    sigmas = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 7.0, 10.0)
    for sensor, colour in (("conscan", BLUE), ("program", ORANGE)):
        held = [certified(station, one, sensor, sigma).held_90_s for sigma in sigmas]
        axes.plot(
            sigmas, held, "o-", color=colour, ms=4.0, label=sensor if sensor != "program" else "program track alone"
        )
    axes.legend(frameon=False)
    return figure


def certified(station: rp.Station, one: rp.StationPass, sensor: str, sigma_s: float) -> Any:
    changes = {"ephemeris_publisher": {**one.target.parameters, "uncertainty.along_m": sigma_s * SPEED_M_S}}
    setup = StationSetup(station.description, station.band, changes=changes)
    controller, antenna, start_s = setup.controller(), setup.antenna(), math.floor(one.aos_t_s) - 150.0
    law = setup.sets("ephemeris_publisher")["uncertainty"]
    controller.plan.take_profiles([pass_profile(setup.track(), one.window, law=law)])
    controller.take_joints(antenna.reading(start_s))
    controller.start(start_s, one.window, sensor)
    return controller.plan.certificate.chosen


def search() -> Figure:
    """The way of the beam 3 min before the top of a pass, and where the target may be."""
    figure, axes = picture("search, sigma 4 s, 200 s into the pass", "right of the prediction, deg", "above it, deg")
    station = rp.Station("leo_3m7", "X")
    one = station.passes(rp.elements("CBERS 2"), days=2, min_peak_deg=40.0)[0]
    setup = StationSetup(station.description, "X")
    sets, fine = setup.sets("pointing_controller"), pass_profile(setup.track(), one.window).resampled()
    path = TrackPath(fine.t_s, fine.position_rad, fine.range_m, station.site.latitude_rad)
    known = TrimFilter(prior_of(sets["trim"], AHEAD_S, 1500.0))
    begin_s = one.aos_t_s + 200.0
    times = begin_s + np.arange(0.0, 60.0, 0.1)
    _, motion = path.moved(times, 0.0)
    sky = SkyMotion(motion[:, 0], motion[:, 1], np.interp(times, fine.t_s, fine.range_m))
    pattern = ScanPatterns(Scans(sets["spiral"], sets["calibration"].scan, None, type("Sets", (), sets)))
    pattern.begin(Mode.SEARCH, begin_s, known, sky, path, uncertain=True)
    beam = np.degrees(pattern.at(times, sky)[0])
    axes.plot(*beam.T, color=BLUE, lw=1.0, label="the beam's axis in 60 s")
    targets = np.array([np.degrees(path.moved(times[:1], each)[0][0]) for each in np.linspace(-12.0, 12.0, 25)])
    axes.plot(*targets.T, "o", color=ORANGE, ms=4.0, label="targets early and late, 1 s apart")
    axes.set_aspect("equal")
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.05, 1.0))
    return figure


def learned() -> Figure:
    """How far ahead the target is, as passes teach it, against the law alone."""
    figure, axes = picture("a satellite 4 s off its elements", "hours after the first pass", "sigma along the track, s")
    station, law = rp.Station("leo_3m7", "X"), ElementUncertainty(along_m=AHEAD_S * SPEED_M_S)
    passes = station.passes(rp.elements("CBERS 2"), days=2, min_peak_deg=60.0)[:2]
    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder) / "learned.json")
        changes: dict[str, dict[str, object]] = {
            "ephemeris_publisher": {"uncertainty.along_m": AHEAD_S * SPEED_M_S, "publisher.learned_file": file},
            "rf_receiver": {"source.along_track_offset_s": AHEAD_S},
        }  # fmt: skip
        track, first_s = station.track_of(passes[0].target), passes[0].window.tca_t_s
        edges = [each.window.tca_t_s for each in passes] + [passes[-1].window.tca_t_s + 10.0 * 3600.0]
        for number, one in enumerate(passes):
            station.simulate(one, sensor="conscan", changes=changes)
            known = LearnedTimes(file).of(track, edges[number], law)
            assert known is not None
            times = np.linspace(edges[number], edges[number + 1], 50)
            axes.plot((times - first_s) / 3600.0, [known.sigma_s(t) for t in times], color=GREEN,
                      label=f"after {number + 1} pass{'es' * bool(number)}", ls=("-", "--")[number])  # fmt: skip
    axes.axhline(AHEAD_S, color=BLUE, label="the elements alone")
    axes.set_yscale("log")
    axes.legend(frameon=False)
    return figure


def main() -> None:
    """Draw all of them into the folder of this file."""
    with rc_context(STYLE):
        for draw in (age, promised, search, learned):
            draw().savefig(FOLDER / f"target_{draw.__name__}.png", dpi=110)


if __name__ == "__main__":
    main()
