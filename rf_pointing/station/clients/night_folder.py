"""Files of a night: its journal, a recording and a report of every pass."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from itertools import count
from pathlib import Path
from typing import Any, Protocol

from rf_pointing.core import utc_text, write_whole
from rf_pointing.operations import JournalEntry
from rf_pointing.operations.pass_work import VERDICT, PassRecord

# Seconds of processor time: a process of its own, behind all others where nothing waits for it.
_RUN = "from rf_pointing.commands.{} import main; main()"
_BEHIND = f"import os; os.nice(19); {_RUN}"
OFFSETS, MODEL = "offsets.csv", "model.yaml"
"""Table of the scans of a night, and the model that is fitted to them and to its recordings."""
SCANNING, COMPLETE = "scanning", "complete"


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
        self._refining: tuple[subprocess.Popen[bytes], Path, Path] | None = None
        self._fitting: subprocess.Popen[bytes] | None = None
        self._scan: subprocess.Popen[bytes] | None = None
        self.scanned = ""
        """Id of the scan that was begun last."""

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
        nowhere = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        command = [sys.executable, "-c", _BEHIND.format("report"), name, "--output", name]
        process = subprocess.Popen(command, **nowhere)  # type: ignore[call-overload]
        self._reports.append(process)
        return name

    def refine(self, names: Sequence[str], elements: Path, further: Sequence[str]) -> None:
        """Begin to determine an orbit from the recordings of these passes, the newest last.

        It begins with the `elements`, not with what came of it before: a pass must count once.
        Refined elements go next to them, where they are better.
        """
        folder = self.path / "passes" / names[-1]
        command = [_BEHIND.format("orbit_from_passes"), *self._bags(names), "--elements", str(elements),
                   "--if-better", "--output", str(folder / "orbit"), *further]  # fmt: skip
        self._refining = _python(command, folder / "orbit.txt"), folder, elements

    def scan(self, name: str, target: str, pattern: str, antenna: str) -> str:
        """Begin a scan by the client of `antenna`; its result goes into the folder of the pass."""
        self.end_scan()
        folder = self.path / "passes" / name
        folder.mkdir(parents=True, exist_ok=True)
        command = [_RUN.format("station"), "--namespace", f"/{antenna}", "scan", target]
        table = str(self.path / OFFSETS)
        options = ["--pattern", pattern, "--table", table, "--output", str(folder)]
        self._scan, self.scanned = _python([*command, *options], folder / "scan.txt"), name
        return str(folder)

    @property
    def scan_state(self) -> str:
        """State of the scan that was begun last: scanning, complete, or why it failed."""
        if self._scan is None or (code := self._scan.poll()) is None:
            return SCANNING if self._scan else ""
        said = self.path / "passes" / self.scanned / "scan.txt"
        return _last_word(said) if code else COMPLETE

    def end_scan(self) -> None:
        """End a scan under way: its client cancels it."""
        if self._scan is not None and self._scan.poll() is None:
            self._scan.terminate()
        self._scan = None

    def fit(self, names: Sequence[str], further: Sequence[str]) -> None:
        """Begin to fit a bias model to the scans of the night and the recordings of passes."""
        table = self.path / OFFSETS
        data = [*self._bags(names), *([str(table)] if table.exists() else [])]
        if data:
            command = [_BEHIND.format("fit_bias_model"), *data, "--output", str(self.path / MODEL)]
            self._fitting = _python([*command, *further], self.path / "model.txt")

    def fitted(self) -> tuple[str, bool]:
        """Return what came of the fit in words, once, and whether there is a model; "" before."""
        if self._fitting is None or (code := self._fitting.poll()) is None:
            return "", False
        self._fitting = None
        if code:
            return f"no bias model of this night: {_last_word(self.path / 'model.txt')}", False
        return f"bias model of this night: {self.path / MODEL}; its doubts are in model.txt", True

    def _bags(self, names: Sequence[str]) -> list[str]:
        folders = [self.path / "passes" / name for name in names]
        return [str(each) for folder in folders for each in sorted(folder.glob("bag*"))]

    @property
    def refining(self) -> bool:
        """Whether an orbit is being determined."""
        return self._refining is not None

    def refined(self) -> str:
        """Put refined elements that have been found into force; return what came of them, or ""."""
        if self._refining is None or (code := self._refining[0].poll()) is None:
            return ""
        (_, folder, elements), self._refining = self._refining, None
        if code:
            last = _last_word(folder / "orbit.txt")
            return f"elements not refined from passes up to {folder.name}: {last}"
        # One file for each satellite: the newest orbit has all passes of the night in it.
        text = (folder / "orbit.omm").read_text(encoding="utf-8")
        satellite = re.search(r"OBJECT_ID\s*=\s*(\S+)", text)
        place = elements.parent / f"refined-{satellite[1] if satellite else folder.name}.omm"
        write_whole(place, text)
        return f"elements refined from passes up to {folder.name}: {place}"


def _python(command: Sequence[str], said: Path) -> Any:
    """Begin code with arguments in a process of its own, whose words go to a file."""
    with said.open("w") as words:
        return subprocess.Popen(
            [sys.executable, "-c", *command], stdin=subprocess.DEVNULL, stdout=words, stderr=words
        )  # fmt: skip


def _last_word(said: Path) -> str:
    lines = said.read_text(encoding="utf-8", errors="replace").splitlines() if said.exists() else []
    return lines[-1] if lines else "it has ended without a word"
