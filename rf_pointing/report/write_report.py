"""From a bag to a report: `report.html`, `summary.json` and the pictures beside them."""

from pathlib import Path

from rf_pointing.report.analysis import analyse
from rf_pointing.report.page import page
from rf_pointing.report.pictures import draw_pictures
from rf_pointing.report.recording import read_recording
from rf_pointing.report.statistics import summarize
from rf_pointing.report.summary import Summary, to_json

__all__ = ["write_report"]


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
