"""From a bag to a report: `report.html`, and next to it `summary.json` and the pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, replace
from pathlib import Path

from rf_pointing.operations.pass_work import VERDICT
from rf_pointing.report.analysis import analyse
from rf_pointing.report.error_ledger import PICTURE, Ledger, draw_ledger
from rf_pointing.report.html import Cell, number, render
from rf_pointing.report.outcome import judged_by_night
from rf_pointing.report.pictures import draw_pictures
from rf_pointing.report.recording import read_recording
from rf_pointing.report.statistics import summarize
from rf_pointing.report.summary import ErrorStatistics, Headline, ModeStatistics, Summary, to_json

Row = Sequence[Cell]
BAR = (
    "Where the loss comes from",
    "Each part is what one cause costs, the line the loss. Left of 0: causes that undo others.",
)


def write_report(bag_path: Path | str, output_dir: Path | str, *, namespace: str | None = None) -> Summary:
    """Write the report of one antenna and return its table.

    `bag_path` is a bag directory, or one MCAP or sqlite3 file, `namespace` one of several antennas
    in it.  The folder is made if it is missing, an older report in it replaced.  ValueError for a
    recording that cannot be read, or holds no antenna, or several.
    """
    analysis = analyse(read_recording(bag_path, namespace=namespace))
    summary = summarize(analysis)
    folder = Path(output_dir)
    folder.mkdir(parents=True, exist_ok=True)
    summary = replace(summary, outcome=judged_by_night(summary.outcome, folder / VERDICT))
    ledger: Ledger | None = None
    try:
        ledger = Ledger.read(folder)
    except ValueError as error:
        summary.problems.append(str(error))
    pictures = draw_pictures(analysis, folder)
    if ledger is not None:
        draw_ledger(ledger, folder / PICTURE)
        pictures = {folder / PICTURE: BAR, **pictures}
    (folder / "report.html").write_text(page(summary, pictures, ledger), encoding="utf-8")
    (folder / "summary.json").write_text(to_json(summary), encoding="utf-8")
    return summary


def page(summary: Summary, pictures: Mapping[Path, tuple[str, str]], ledger: Ledger | None = None) -> str:
    """Return the HTML text of the report; pictures are embedded."""
    found = summary.target_pass
    lost = [
        f"{number(item.count)} messages of {item.topic} were not recorded, from {item.first_lost_utc} on"
        for item in summary.not_recorded
    ]
    return render(
        "pass.html",
        title=f"Pass of {found.target}" if found is not None else f"Recording of {summary.bag.namespace}",
        summary=summary, pictures=pictures, complaints=[*summary.problems, *lost],
        tables=_tables(summary) | {"ledger": list(ledger.rows()) if ledger else []}, ledger=ledger,
    )  # fmt: skip


def _tables(summary: Summary) -> dict[str, list[Row]]:
    """Return the rows of each table of the page by name."""
    counter = "executive in all attempts" if summary.outcome.source == "night" else "controller"
    return {
        "outcome": [
            (name, *astuple(numbers))
            for name, numbers in (
                ("predicted by the certificate", summary.outcome.predicted),
                (f"counted by the {counter}", summary.outcome.counted),
                ("flown, by the true error", summary.outcome.flown),
            )
            if numbers is not None
        ],
        "errors": _error_rows(summary),
        "modes": [
            (f"{int(i.start_s) // 60}:{i.start_s % 60:04.1f}", i.mode.replace("_", " "), i.seconds, i.reason)
            for i in summary.timeline
        ],
        "axes": [astuple(axis) for axis in summary.servo.axes],
        "topics": [
            (i.topic if i.sensor is None else f"{i.topic} ({i.sensor})", i.count, i.rate_hz, i.wall_rate_hz, i.lost,
             i.not_recorded, i.restarts, i.longest_gap_s, i.counted_by)
            for i in summary.topics
        ],
        "latency": [astuple(hop) for hop in summary.latency],
        "warnings": [astuple(warning) for warning in summary.warnings],
    }  # fmt: skip


def _error_rows(summary: Summary) -> list[Row]:
    # The headline is the first row, before the modes it is made of.
    named: list[tuple[str, Headline | ModeStatistics]] = [(summary.headline.over, summary.headline)]
    named += [(each.mode.replace("_", " "), each) for each in summary.modes]
    found: list[Row] = []
    for name, row in named:
        alone = row.program_track_alone
        if row.error is not None:
            found.append((name, row.seconds, *_error_cells(row.error)))
        # Without an offset in the status it is not known what program track alone would do.
        if alone is not None and alone.samples:
            found.append(("\u2003program track alone", None, *_error_cells(alone)))
    return found


def _error_cells(error: ErrorStatistics) -> tuple[Cell, ...]:
    radial, loss = error.radial, (error.mean_loss_db, error.max_loss_db)
    axes = *astuple(error.cross_elevation), *astuple(error.elevation)
    return (*axes, radial.rms_mdeg, radial.max_mdeg, *loss, error.inside_half_power_percent)
