"""Files of a night: its journal, a recording and a report of every pass."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from itertools import count
from pathlib import Path
from typing import Any, Protocol

from rf_pointing.core.dates import utc_text
from rf_pointing.core.whole_file import write_whole
from rf_pointing.operations import JournalEntry
from rf_pointing.operations.pass_work import VERDICT, PassRecord

_REPORT = "import os; os.nice(19); from rf_pointing.commands.report import main; main()"


class Recording(Protocol):
    """A recording under way; `problem` is "" while it goes on."""

    @property
    def problem(self) -> str: ...

    def close(self) -> Any: ...


class NightFolder:
    """The folder `path`; `record(bag, notes)` begins a recording.

    `problem` says why the newest journal or report could not be written.
    """

    def __init__(self, path: str, record: Callable[[Path, Mapping[str, str]], Recording]) -> None:
        self.path = Path(path).expanduser().resolve()
        self.path.mkdir(parents=True, exist_ok=True)
        self.problem = ""
        self._begin = record
        self._recording: Recording | None = None
        self._folder: Path | None = None
        self._reports: list[subprocess.Popen[bytes]] = []

    @property
    def recorder(self) -> str:
        """State of the recorder: idle, recording or failed."""
        self._reports = [each for each in self._reports if each.poll() is None]
        return "idle" if self._recording is None else "failed" if self._recording.problem else "recording"

    def write_journal(self, rows: Sequence[JournalEntry]) -> None:
        """Append rows to journal.jsonl."""
        path = self.path / "journal.jsonl"
        try:
            with path.open("a", encoding="utf-8") as file:
                file.writelines(json.dumps({"utc": utc_text(row.t_s), **asdict(row)}) + "\n" for row in rows)
            self.problem = ""
        except OSError as error:
            self.problem = f"journal {path} cannot be written: {error.strerror}"

    def write_morning(self, now_s: float, write: Callable[[Path], None]) -> str:
        """Let `write(folder)` write the morning report; return its folder, "" if that fails."""
        folder = self.path / f"report-{utc_text(now_s)[:16].replace(':', '')}"
        try:
            write(folder)
        except OSError as error:
            self.problem = f"report {folder} cannot be written: {error.strerror}"
            return ""
        return str(folder)

    def record(self, name: str, needed_gb: float, notes: Mapping[str, str]) -> str:
        """Record a pass in a folder of its own, and return it; OSError on a disk that is full.

        A pass that is joined again goes on in its recording, after a restart in a further bag.
        """
        folder = self.path / "passes" / name
        if self._folder == folder and self.recorder == "recording":
            return str(folder)
        self.end_record()
        if (free_gb := shutil.disk_usage(self.path).free / 1e9) < needed_gb:
            raise OSError(f"{free_gb:.3g} GB are free, must be >= {needed_gb:g} GB")
        folder.mkdir(parents=True, exist_ok=True)
        bags = (folder / f"bag{f'-{number}' if number > 1 else ''}" for number in count(1))
        self._recording = self._begin(next(each for each in bags if not each.exists()), {**notes, "pass": name})
        self._folder = folder
        return str(folder)

    def judge(self, record: PassRecord) -> None:
        """Write the verdict on a pass next to its recording: that of its report."""
        folder = self.path / "passes" / record.id
        if folder.is_dir():
            try:
                write_whole(folder / VERDICT, json.dumps(asdict(record), indent=1) + "\n")
            except OSError as error:
                self.problem = f"{folder / VERDICT} cannot be written: {error.strerror}"

    def end_record(self) -> str:
        """End the recording and begin its report; return its path."""
        recording, self._recording = self._recording, None
        if recording is None:
            return "nothing is recorded"
        path: Path = recording.close().path
        self.report(str(path.parent))
        return str(path)

    def report(self, name: str) -> str:
        """Begin the report on the recordings of a pass."""
        # Seconds of processor time: a process of its own, behind all others.
        nowhere = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        command = [sys.executable, "-c", _REPORT, name, "--output", name]
        process = subprocess.Popen(command, **nowhere)  # type: ignore[call-overload]
        self._reports.append(process)
        return name
