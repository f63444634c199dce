"""A recorded pass as an object: its topics as tables, its report, its data for other programs."""

import time
from functools import cached_property
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rf_pointing import __version__
from rf_pointing.calibration import write_tdm
from rf_pointing.report import antennas, export_recording, read_recording, topic_table, write_report
from rf_pointing.report.export import FORMATS, exported_topics
from rf_pointing.report.recording import Recording as RecordingData
from rf_pointing.report.tracking_from_bag import tracking_from_bag

EXPORTS = (*FORMATS, "tdm")
"""Formats of `Recording.export`: tables, or the tracked angles as a CCSDS TDM."""


class Recording:
    """A rosbag2 recording of one antenna, of `track` or of `ros2 bag record -a`; no ROS is needed.

    Parameters
    ----------
    path : bag directory, or one of its files.
    namespace : which antenna; needed where the bag holds several.

    The bag is read when something of it is wanted; every method raises ValueError where nothing of
    it can be read, or where it holds several antennas and none is named.

    Examples
    --------
    >>> recording = rp.Recording("runs/28057-20060627T045843-01/bag")
    >>> recording.to_pandas("tracking_status")["cross_elevation_error_rad"].std()
    """

    def __init__(self, path: str | Path, *, namespace: str | None = None) -> None:
        self.path, self.namespace = Path(path), namespace

    @cached_property
    def data(self) -> RecordingData:
        """Everything that was read: topics with their columns as they were sent, passes, losses."""
        return read_recording(self.path, namespace=self.namespace)

    @property
    def topics(self) -> list[str]:
        """The topics that `table` gives."""
        return exported_topics(self.data)

    @property
    def notes(self) -> dict[str, str]:
        """Notes of the recorder: station, band, sensor and others."""
        return self.data.notes

    @property
    def problems(self) -> tuple[str, ...]:
        """Damaged or lost parts, as sentences."""
        return self.data.problems

    def table(self, topic: str = "tracking_status") -> dict[str, NDArray[Any]]:
        """Return a topic as columns (n,), a row for each message; names end in their units.

        Raises ValueError for a topic that the recording does not have.
        """
        return topic_table(self.data, topic)

    def to_pandas(self, topic: str = "tracking_status") -> Any:
        """Return the same as a DataFrame with the stamps (UTC) as its index; needs pandas."""
        import pandas

        columns = self.table(topic)
        index = pandas.to_datetime(columns["stamp_ns"], unit="ns", utc=True)
        return pandas.DataFrame(columns, index=index.rename("utc"))

    def report(self, folder: str | Path | None = None) -> list[Path]:
        """Write the HTML report with its summary and pictures; return its pages.

        They go to `folder`, by default that of the bag.  Other packages add pages through the entry
        point group `rf_pointing.reports`: a function of bag and folder that writes its page and
        returns the path, or None if the bag has no data for it.
        """
        folder = Path(folder or self.path.parent)
        pages = [entry.load()(self.path, folder) for entry in entry_points(group="rf_pointing.reports")]
        written = [page for page in pages if page is not None]
        # Without any page, `write_report` states what the bag lacks.
        if antennas(self.path) or not written:
            write_report(self.path, folder, namespace=self.namespace)
            written.append(folder / "report.html")
        return written

    def export(self, kind: str, folder: str | Path | None = None) -> list[Path]:
        """Write the data as csv, parquet, mat or tdm into `folder`; return the files.

        By default they go to `export` next to the bag.  The sound part of a damaged recording is
        taken.  Raises ValueError for another form, and for a TDM of unknown station or band.
        """
        folder = Path(folder or self.path.parent / "export")
        if kind != "tdm":
            return export_recording(self.data, folder, kind)
        missing = [name for name in ("station", "band") if not self.notes.get(name)]
        if missing:
            raise ValueError(f"export=tdm: the notes of {self.path} name no {' and no '.join(missing)}")
        if (mount := self.data.mount) is None:
            axes = " and ".join(self.data.axes)
            raise ValueError(f"export=tdm: the notes of {self.path} must name the mount of its axes {axes}")
        tracks = tracking_from_bag(
            self.path, self.notes["station"], self.notes["band"], namespace=self.namespace, allow_damage=True
        )
        path = folder / "tracking.tdm"
        path.parent.mkdir(parents=True, exist_ok=True)
        raw = [one for one, _ in tracks]
        write_tdm(path, raw, originator=f"rf_pointing {__version__}", created_t_s=time.time(), mount=mount)
        return [path]
