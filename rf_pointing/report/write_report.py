"""The report as one HTML file that needs nothing else: headline numbers, pictures, tables, and what is missing.

From a bag to a report: `report.html`, `summary.json` and the pictures beside them.
"""

from collections.abc import Sequence
from pathlib import Path

from rf_pointing.report.analysis import analyse
from rf_pointing.report.html import Cell, document, figure, number, table, text
from rf_pointing.report.pictures import Picture, draw_pictures
from rf_pointing.report.recording import read_recording
from rf_pointing.report.statistics import summarize
from rf_pointing.report.summary import ErrorStatistics, Headline, Summary, to_json

__all__ = ["page", "write_report"]


_ERROR_HEAD = (
    "",
    "s",
    "xel rms",
    "xel p95",
    "xel max",
    "el rms",
    "el p95",
    "el max",
    "radial rms",
    "radial max",
    "loss mean, dB",
    "loss max, dB",
    "in half power, %",
)


def page(summary: Summary, pictures: Sequence[Picture]) -> str:
    """Return the HTML text of the report; pictures are embedded."""
    parts = (
        _heading(summary),
        _tiles(summary),
        _notice(summary),
        *(figure(p.path, p.title, p.caption, narrow=p.path.stem == "sky_track") for p in pictures),
        _errors(summary),
        _course(summary),
        _machine(summary),
        _traffic(summary),
        _latency(summary),
        _complaints(summary),
    )
    return document(_title(summary), parts)


def _title(summary: Summary) -> str:
    found = summary.target_pass
    return f"Pass of {found.target}" if found is not None else f"Recording of {summary.bag.namespace}"


def _heading(summary: Summary) -> str:
    bag, found = summary.bag, summary.target_pass
    lines = [f"<h1>{text(_title(summary))}</h1>"]
    if found is not None:
        lines.append(
            f"<p>Acquisition {text(_clock(found.aos_utc))}, closest approach {text(_clock(found.tca_utc))}, loss "
            f"{text(_clock(found.los_utc))} UTC; peak elevation {number(found.peak_elevation_deg)}°.</p>"
        )
    speed = f" at {number(bag.speed)} times real time" if bag.speed is not None else ""
    lines.append(
        f'<p class="soft">Antenna {text(bag.namespace)}, {number(bag.message_count)} messages over '
        f"{number(bag.simulated_s)} s{speed}, from {text(_clock(bag.start_utc or 'an unknown time'))}. "
        f"{_notes(bag.notes)}</p>"
    )
    return "\n".join(lines)


def _clock(utc: str) -> str:
    return utc.replace("T", " ").removesuffix("Z").partition(".")[0]


def _notes(notes: dict[str, str]) -> str:
    return " ".join(f"{text(key)}: {text(value)}." for key, value in sorted(notes.items()))


def _tiles(summary: Summary) -> str:
    headline = summary.headline
    tiles = [_held(headline), *_error_tiles(headline)]
    lost = headline.messages_lost
    tiles.append(_tile(number(lost), "messages lost", "good" if lost == 0 else "bad"))
    settled = summary.acquisition.settled_s
    if settled is not None:
        tiles.append(
            _tile(f"{number(settled)} s", f"from {summary.acquisition.measured_from} until settled on the beam")
        )
    lead = summary.commands.lead_min_s
    if lead is not None:
        tiles.append(_tile(f"{number(lead)} s", "smallest command lead"))
    late = summary.servo.tick_lateness_p99_ms
    if late is not None:
        tiles.append(_tile(f"{number(late)} ms", "servo tick late, 99th percentile"))
    return f'<div class="tiles">{"".join(tiles)}</div>'


def _held(headline: Headline) -> str:
    if headline.held_beam is None or headline.error is None:
        return _tile("unknown", "held the beam")
    inside = (
        f"{number(headline.error.inside_half_power_percent, 4)} % of {number(headline.seconds)} s inside half power"
    )
    return _tile(
        "yes" if headline.held_beam else "no", f"held the beam: {inside}", "good" if headline.held_beam else "bad"
    )


def _error_tiles(headline: Headline) -> list[str]:
    error, alone = headline.error, headline.program_track_alone
    if error is None:
        return []
    rms = f"{number(error.cross_elevation.rms_mdeg)} / {number(error.elevation.rms_mdeg)}"
    tiles = [_tile(f"{rms} mdeg", f"{headline.error_source} error, rms cross-elevation / elevation, {headline.over}")]
    if error.mean_loss_db is not None:
        beam = f"of a {number(headline.beamwidth_mdeg)}-mdeg beam" if headline.beamwidth_mdeg else ""
        tiles.append(_tile(f"{number(error.mean_loss_db, 2)} dB", f"mean pointing loss {beam}"))
    if alone is not None and alone.mean_loss_db is not None:
        missed = f"{number(alone.cross_elevation.rms_mdeg)} / {number(alone.elevation.rms_mdeg)} mdeg"
        # One beamwidth off costs 12 dB; farther out the main lobe, and with it the Gaussian, has ended.
        loss = number(alone.mean_loss_db, 2) if alone.mean_loss_db <= 12.0 else "more than 12"
        tiles.append(_tile(missed, f"rms of program track alone, {loss} dB lost"))
    return tiles


def _tile(value: str, label: str, kind: str = "") -> str:
    return f'<div class="tile {kind}"><b>{value}</b><span>{text(label)}</span></div>'


def _notice(summary: Summary) -> str:
    if not summary.problems and not summary.not_recorded:
        return ""
    items = [text(problem) for problem in summary.problems]
    items += [
        f"{number(item.count)} messages of {text(item.topic)} were not recorded, from {text(item.first_lost_utc)} "
        "(wall clock) on"
        for item in summary.not_recorded
    ]
    listed = "".join(f"<li>{item}</li>" for item in items)
    return f'<div class="notice"><b>What this recording does not tell</b><ul>{listed}</ul></div>'


def _errors(summary: Summary) -> str:
    headline = summary.headline
    rows: list[Sequence[Cell]] = []
    if headline.error is not None:
        rows.append(_error_row(headline.over, headline.seconds, headline.error))
        rows += _alone_row(headline.program_track_alone)
    for mode in summary.modes:
        rows.append(_error_row(mode.mode.replace("_", " "), mode.seconds, mode.error))
        rows += _alone_row(mode.program_track_alone)
    if not rows:
        return ""
    return (
        f"<h2>Pointing error by mode</h2><p>{text((headline.error_source or 'no').capitalize())} error in mdeg: target "
        "minus beam, in cross-elevation and elevation. The line below a mode says what program track alone would have "
        "made of the same samples. Loss: Gaussian beam, only where the beam was meant to be on the target.</p>"
        f"{table(_ERROR_HEAD, rows)}{_settled(summary)}"
    )


def _error_row(name: str, seconds: float | None, error: ErrorStatistics) -> Sequence[Cell]:
    across, along, radial = error.cross_elevation, error.elevation, error.radial
    return (
        name,
        seconds,
        *(across.rms_mdeg, across.p95_mdeg, across.max_mdeg),
        *(along.rms_mdeg, along.p95_mdeg, along.max_mdeg),
        *(radial.rms_mdeg, radial.max_mdeg),
        *(error.mean_loss_db, error.max_loss_db, error.inside_half_power_percent),
    )


def _alone_row(alone: ErrorStatistics | None) -> list[Sequence[Cell]]:
    return [_error_row("\u2003program track alone", None, alone)] if alone is not None and alone.samples else []


def _settled(summary: Summary) -> str:
    found = summary.acquisition
    if found.first_valid_s is None:
        return '<p class="soft">No sensor gave a valid error.</p>'
    settled = f"{number(found.settled_s)} s" if found.settled_s is not None else "never"
    return (
        f'<p class="soft">First valid sensor error {number(found.first_valid_s)} s after {text(found.measured_from)}; '
        f"settled (five in a row below {number(found.settled_below_mdeg)} mdeg, a tenth of the beam): {settled}.</p>"
    )


def _course(summary: Summary) -> str:
    rows = [
        (_minutes(item.start_s), item.mode.replace("_", " "), item.seconds, item.reason) for item in summary.timeline
    ]
    if not rows:
        return ""
    return f"<h2>Course of the pass</h2>{table(('at', 'mode', 's', 'because'), rows, words=(0, 1, 3))}"


def _minutes(seconds: float) -> str:
    return f"{int(seconds) // 60}:{seconds % 60:04.1f}"


def _machine(summary: Summary) -> str:
    servo, commands, link = summary.servo, summary.commands, summary.link
    axes = [
        (
            item.axis,
            *(item.peak_rate_deg_s, item.rate_limit_deg_s),
            *(item.peak_acceleration_deg_s2, item.acceleration_limit_deg_s2, item.at_limit_s),
        )
        for item in servo.axes
    ]
    head = ("axis", "peak rate, deg/s", "limit", "peak acceleration, deg/s²", "limit", "s at a limit")
    rows: list[Sequence[Cell]] = [
        ("command lead, smallest, s", commands.lead_min_s),
        ("command lead, median, s", commands.lead_median_s),
        ("commands left in the servo, smallest, s", commands.servo_lead_min_s),
        ("commands sent / accepted / rejected", _counts(commands.sent, commands.accepted, commands.rejected)),
        ("last rejection", commands.last_rejection),
        ("servo tick late, 99th percentile, ms", servo.tick_lateness_p99_ms),
        ("servo tick late, largest, ms", servo.tick_lateness_max_ms),
        ("servo period deviation at the recorder, 99th percentile, ms", servo.period_deviation_p99_ms),
        ("faults", "; ".join(servo.faults) or "none"),
        (f"C/N0 from {link.source or 'no topic'}, {link.over}, smallest, dB-Hz", link.carrier_to_noise_min_db_hz),
        (f"C/N0 from {link.source or 'no topic'}, {link.over}, median, dB-Hz", link.carrier_to_noise_median_db_hz),
    ]
    return f"<h2>Antenna, commands and link</h2>{table(head, axes)}<br>{table(('quantity', 'value'), rows)}"


def _counts(*values: int | None) -> str:
    return " / ".join(number(value) for value in values)


def _traffic(summary: Summary) -> str:
    rows = [
        (
            item.topic if item.sensor is None else f"{item.topic} ({item.sensor})",
            item.count,
            *(item.rate_hz, item.wall_rate_hz, item.lost, item.not_recorded, item.restarts, item.longest_gap_s),
            item.counted_by,
        )
        for item in summary.topics
    ]
    head = (
        "topic",
        "messages",
        "Hz",
        "Hz, wall",
        "lost",
        "not recorded",
        "restarts",
        "longest gap, s",
        "lost counted by",
    )
    return (
        "<h2>Topics</h2><p>Rates are in simulation time, and at the recorder's wall clock. A gap of more than ten "
        "periods in a topic without sequence numbers is a pause of its publisher, not a loss.</p>"
        f"{table(head, rows, words=(0, 8))}"
    )


def _latency(summary: Summary) -> str:
    rows = [(i.cause, i.effect, i.kind, i.count, i.median_ms, i.p99_ms, i.max_ms) for i in summary.latency]
    if not rows:
        return ""
    head = ("from", "to", "kind", "pairs", "median, ms", "99th percentile, ms", "largest, ms")
    return (
        "<h2>Latency per hop</h2><p>Wall time between the reception of linked messages at the recorder. Transit: equal "
        "stamps (adjacent ones where none are equal). Reaction: the first message out after one in, its waiting for "
        "the next tick included.</p>"
        f"{table(head, rows, words=(0, 1, 2))}"
    )


def _complaints(summary: Summary) -> str:
    rows = [(item.component, item.message, item.count) for item in summary.warnings]
    head = ("component", "message", "times")
    return f"<h2>Diagnostics above OK</h2>{table(head, rows, words=(0, 1))}" if rows else ""


def write_report(bag_path: Path | str, output_dir: Path | str, *, namespace: str | None = None) -> Summary:
    """Write the report of one antenna and return its table.

    Parameters
    ----------
    bag_path
        Any rosbag2 recording: a bag directory, or one MCAP or sqlite3 file.
    output_dir
        Folder of the report; made if it is missing, an older report in it is replaced.
    namespace
        Which antenna, needed when the bag holds several.

    Raises
    ------
    ValueError
        The recording cannot be read, or holds no antenna, or several.
    """
    analysis = analyse(read_recording(bag_path, namespace=namespace))
    summary = summarize(analysis)
    folder = Path(output_dir)
    folder.mkdir(parents=True, exist_ok=True)
    pictures = draw_pictures(analysis, folder)
    (folder / "report.html").write_text(page(summary, pictures), encoding="utf-8")
    (folder / "summary.json").write_text(to_json(summary), encoding="utf-8")
    return summary
