"""Quantities derived from a recording once: modes, errors, the tracked pass, and the acquisition.

    error = target - beam
    alone = error + offset                                          (program track alone)
    loss  = -10 log10 g,  g >= sidelobes                            (core/pass_outcome.py)

The tracking loop moves the beam by its offset; without it the error would have been larger by that
offset.  The table and the pictures of a report share this.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, Array, BoolArray, IntArray, Mode
from rf_pointing.core.pass_outcome import is_held, pointing_loss_db, received_power
from rf_pointing.report.recording import Pass, Recording
from rf_pointing.report.summary import Acquisition, ErrorStatistics, Spread, reduced
from rf_pointing.report.topics import TopicData
from rf_pointing.tracking.sensors import SENSORS


def tracking_modes() -> tuple[str, ...]:
    """Return the modes in which the beam is meant to be on the target."""
    return (Mode.PROGRAM_TRACK, Mode.SEARCH, *SENSORS, Mode.COAST)


@dataclass(frozen=True)
class Interval:
    """One stretch of one mode, stamps in nanoseconds."""

    mode: str
    start_ns: int
    end_ns: int
    reason: str

    @property
    def seconds(self) -> float:
        """Length in simulated seconds."""
        return (self.end_ns - self.start_ns) * 1e-9


@dataclass(frozen=True)
class Timeline:
    """Status of the controller in order of its stamps; a mode holds from one stamp to the next."""

    stamp_ns: IntArray
    columns: dict[str, NDArray[Any]]

    def mode_at(self, stamp_ns: IntArray) -> NDArray[np.str_]:
        """Return the mode at each stamp, "" before the first status."""
        # Before the first status nothing is known, not the mode of that status.
        return np.where(stamp_ns < self.stamp_ns[0], "", self._held("mode", stamp_ns))

    def beamwidth_rad_at(self, stamp_ns: IntArray) -> Array:
        """Return the half-power beamwidth at each stamp; NaN where the controller gave none."""
        width = self._held("beamwidth", stamp_ns).astype(np.float64)
        return np.where(width > 0.0, width, np.nan)

    def offset_rad_at(self, stamp_ns: IntArray) -> Array:
        """Return the interpolated tracking offset (n, 2) in cross-elevation and elevation."""
        # Stamps differ from the first one by seconds: the difference keeps nanoseconds in a float.
        at, known = ((s - self.stamp_ns[0]) * 1e-9 for s in (stamp_ns, self.stamp_ns))
        names = ("cross_elevation_offset", "elevation_offset")
        return np.stack([np.interp(at, known, self.columns[name]) for name in names], axis=-1)

    def intervals(self) -> list[Interval]:
        """Return the stretches of equal mode in order; the last status holds for a usual period."""
        mode = self.columns["mode"]
        starts = np.flatnonzero(np.concatenate([[True], mode[1:] != mode[:-1]]))
        # The median: the controller may have paused.
        period = int(np.median(np.diff(self.stamp_ns))) if len(self.stamp_ns) > 1 else 0
        edges = [*(int(self.stamp_ns[i]) for i in starts), int(self.stamp_ns[-1]) + period]
        reasons, spans = self.columns["reason"], zip(starts, edges[:-1], edges[1:], strict=True)
        return [Interval(str(mode[i]), start, end, str(reasons[i])) for i, start, end in spans]

    def is_tracking_at(self, stamp_ns: IntArray) -> BoolArray:
        """Return whether the beam was meant to be on the target at each stamp."""
        return np.isin(self.mode_at(stamp_ns), tracking_modes())

    def _held(self, column: str, stamp_ns: IntArray) -> NDArray[Any]:
        index = np.searchsorted(self.stamp_ns, stamp_ns, side="right") - 1
        return self.columns[column][np.maximum(index, 0)]


def timeline(recording: Recording) -> Timeline | None:
    """Return the timeline of `recording`, None when it holds no tracking status."""
    status = recording.get("tracking_status")
    if status is None or status.stamp_ns is None:
        return None
    # A controller that was restarted may have stamped a period twice.
    stamps, index = np.unique(status.stamp_ns, return_index=True)
    return Timeline(stamps, {name: values[index] for name, values in status.columns.items()})


@dataclass(frozen=True)
class ErrorSeries:
    """Samples of the error by stamp; `error_rad` and `alone_rad` are (n, 2), the rest (n,).

    `source` is "true" or "sensed"; `alone_rad` is NaN outside the tracking modes, `loss_db` also
    where no beam is known; `dropped` counts the samples that were not finite.
    """

    source: str
    stamp_ns: IntArray
    error_rad: Array
    alone_rad: Array
    mode: NDArray[np.str_]
    beamwidth_rad: Array
    dropped: int

    @property
    def radial_rad(self) -> Array:
        """Angle between target and beam."""
        return np.hypot(self.error_rad[:, 0], self.error_rad[:, 1])

    @property
    def loss_db(self) -> Array:
        """Pointing loss, positive."""
        return pointing_loss_db(received_power(self.radial_rad, self.beamwidth_rad))


def error_series(recording: Recording, modes: Timeline | None) -> ErrorSeries | None:
    """Return the true error, else the sensed one, else None."""
    for name, source in (("sim/pointing_error", "true"), ("pointing_error", "sensed")):
        data = recording.get(name)
        if data is not None and data.stamp_ns is not None and np.any(data["valid"]):
            return _series(source, data.stamp_ns, data, modes)
    return None


def _series(source: str, stamp_ns: IntArray, data: TopicData, modes: Timeline | None) -> ErrorSeries:
    error_rad = np.stack([data["cross_elevation"], data["elevation"]], axis=-1)
    valid, finite = data["valid"], np.all(np.isfinite(error_rad), axis=1)
    # By stamp, not by reception: errors of several sensors overtake each other.
    order = np.flatnonzero(valid & finite)
    order = order[np.argsort(stamp_ns[order], kind="stable")]
    stamp_ns, error_rad = stamp_ns[order], error_rad[order]
    mode = np.full(len(order), "", dtype=np.str_)
    width, alone = np.full(len(order), np.nan), np.full((len(order), 2), np.nan)
    if modes is not None:
        mode = modes.mode_at(stamp_ns)
        tracking = np.isin(mode, tracking_modes())
        # Outside the tracking modes the beam is not meant to be on the target: no loss.
        width = np.where(tracking, modes.beamwidth_rad_at(stamp_ns), np.nan)
        alone = np.where(tracking[:, None], error_rad + modes.offset_rad_at(stamp_ns), np.nan)
    return ErrorSeries(source, stamp_ns, error_rad, alone, mode, width, dropped=int(np.sum(valid & ~finite)))


def statistics_of(error_rad: Array, beamwidth_rad: Array) -> ErrorStatistics:
    """Return the statistics of errors (n, 2) seen by beams (n,), all null when n is 0."""
    radial = np.hypot(error_rad[:, 0], error_rad[:, 1])
    power = received_power(radial, beamwidth_rad)
    mean_power = reduced(np.mean, power)
    # Without a known beam nothing is inside or outside of it.
    inside = is_held(radial, beamwidth_rad)[np.isfinite(beamwidth_rad)]
    across, up, away = map(_spread, (error_rad[:, 0], error_rad[:, 1], radial))
    return ErrorStatistics(
        len(radial), across, up, away,
        mean_loss_db=None if mean_power is None else float(pointing_loss_db(mean_power)),
        max_loss_db=reduced(np.max, pointing_loss_db(power)),
        inside_half_power_percent=100.0 * float(np.mean(inside)) if len(inside) else None,
    )  # fmt: skip


def _spread(error_rad: Array) -> Spread:
    if len(error_rad) == 0:
        return Spread()
    magnitude = np.abs(error_rad) / MDEG
    rms = np.sqrt(np.mean(np.square(magnitude)))
    return Spread(*map(float, (rms, np.percentile(magnitude, 95.0), np.max(magnitude))))


# A tenth of a beamwidth costs 0.12 dB.
_SETTLED_BEAMWIDTHS = 0.1
# A beam that swings through the target is within the limit too, but not so long.
_SETTLED_IN_A_ROW = 5


@dataclass(frozen=True)
class Analysis:
    """A recording and what is derived from it; a part is None if the recording does not give it.

    `acquired_ns` is the stamp at which the RF loop had settled.
    """

    recording: Recording
    modes: Timeline | None
    errors: ErrorSeries | None
    target_pass: Pass | None
    acquired_ns: int | None
    acquisition: Acquisition


def analyse(recording: Recording) -> Analysis:
    """Return the analysis of `recording`."""
    modes = timeline(recording)
    errors, found = error_series(recording, modes), tracked_pass(recording, modes)
    return Analysis(recording, modes, errors, found, *_acquisition(recording, modes, found))


def tracked_pass(recording: Recording, modes: Timeline | None) -> Pass | None:
    """Return the announced pass that overlaps the tracking most, None if none does."""
    if modes is None:
        return None
    spans = [(i.start_ns, i.end_ns) for i in modes.intervals() if i.mode in tracking_modes()]

    def overlap_ns(item: Pass) -> int:
        return sum(max(0, min(end, item.los_ns) - max(start, item.aos_ns)) for start, end in spans)

    # Several passes are announced in advance; only one was tracked.
    best = max(recording.passes, key=overlap_ns, default=None)
    return best if best is not None and overlap_ns(best) > 0 else None


def _acquisition(
    recording: Recording, modes: Timeline | None, found: Pass | None
) -> tuple[int | None, Acquisition]:  # fmt: skip
    """Return the stamp of the first settled sensor error, and the times from AOS.

    Settled: while a sensor closes the loop, the first of five successive valid errors below a tenth
    of a beamwidth.
    """
    sensed, spans = recording.get("pointing_error"), modes.intervals() if modes is not None else []
    begin = next((i.start_ns for i in spans if i.mode in tracking_modes()), None)
    name = "start of tracking" if found is None else "acquisition of signal"
    if found is not None:
        begin = found.aos_ns
    if sensed is None or sensed.stamp_ns is None or modes is None or begin is None:
        return None, Acquisition(measured_from=name)
    order = np.argsort(sensed.stamp_ns, kind="stable")
    order = order[sensed["valid"][order] & (sensed.stamp_ns[order] >= begin)]
    stamps = sensed.stamp_ns[order]
    limit = _SETTLED_BEAMWIDTHS * modes.beamwidth_rad_at(stamps)
    small = np.hypot(sensed["cross_elevation"], sensed["elevation"])[order] < limit
    small &= np.isin(modes.mode_at(stamps), list(SENSORS))
    # 5 in a window of 5: all of them are small.
    run = np.convolve(small, np.ones(_SETTLED_IN_A_ROW, dtype=np.int64), mode="valid") if len(small) else small
    settled = stamps[np.flatnonzero(run == _SETTLED_IN_A_ROW)[:1]]
    return (int(settled[0]) if len(settled) else None), Acquisition(
        measured_from=name,
        first_valid_s=float(stamps[0] - begin) * 1e-9 if len(stamps) else None,
        settled_s=float(settled[0] - begin) * 1e-9 if len(settled) else None,
        settled_below_mdeg=float(limit[0] / MDEG) if len(limit) else None,
    )
