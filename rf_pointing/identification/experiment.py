"""The identification experiment: its rate input, its ticks, and its recording.

The input is white noise or a multisine, bounded in amplitude and travel.  The published experiment
drove one axis with white noise between 0.1 and 1.3 V, always to one side: the friction never
reverses and the travel limits the number of sequences (DSS13-ID Sec. II-C).  `mean_rad_s` is that
one-sided part.

One axis is driven in manual-rate mode while both encoders are recorded.  The whole input is made,
and its travel checked, before anything moves: the integral of the input tells where a perfect
antenna would go.  Sequences run to alternating sides so that the axis stays near its start.  The
measured travel is watched as well, and `abort` ends the motion at once.

A sample lost on its way spoils its sequence, for the input is no longer known to be what the
antenna was given: nothing is filled in.  Samples that came early or late, as on a busy computer,
are taken to where they should have been: inputs are held until the next one, angles are
interpolated between the times at which the device measured them.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import AXES, Params, as_finite_array, parameter, require_between, require_choice
from rf_pointing.core.types import Array, BoolArray, Pair


@dataclass(frozen=True, kw_only=True)
class ExcitationParams(Params):
    """One sequence of rate input."""

    kind: str = parameter("white", "white noise or multisine", choices=("white", "multisine"))
    samples: int = parameter(8192, "samples per sequence", 64, 1_048_576)
    sample_s: float = parameter(0.02, "time between samples", 1e-3, 1.0)
    mean_rad_s: float = parameter(math.radians(0.056), "mean of the rate input", -0.1, 0.1)
    rms_rad_s: float = parameter(math.radians(0.028), "rms of the rate input about its mean", 1e-9, 0.1)
    peak_rad_s: float = parameter(math.radians(0.2), "largest rate input; what exceeds it is clipped", 1e-9, 0.2)
    # Friction at rest sticks and slips with the driven axis, which is not linear.
    idle_rate_rad_s: float = parameter(
        0.0, "constant rate of the other axis, which keeps its friction from sticking", -1e-3, 1e-3
    )
    low_hz: float = parameter(0.01, "lowest frequency of the multisine", 1e-5, 100.0)
    high_hz: float = parameter(12.0, "highest frequency of the multisine", 1e-4, 500.0)

    ordered = ("low_hz < high_hz",)

    def check_together(self) -> None:
        """Refuse a mean beyond the peak and a multisine band that is too high."""
        if abs(self.mean_rad_s) + self.rms_rad_s > self.peak_rad_s:
            raise ValueError(
                f"mean_rad_s={self.mean_rad_s} and rms_rad_s={self.rms_rad_s} together must be <= {self.peak_rad_s}"
            )
        if self.kind == "multisine" and self.high_hz > 0.5 / self.sample_s:
            raise ValueError(f"high_hz={self.high_hz} must be <= {0.5 / self.sample_s} (half the sampling rate)")


def excitation_rad_s(params: ExcitationParams, random: "np.random.Generator") -> Array:
    """Return one sequence (samples,) in rad/s; white noise is uniform, so bounded."""
    if params.kind == "white":
        sequence = random.random(params.samples)
    else:
        sequence = _multisine(params, random)
    # The drawn mean and rms differ from the wanted by chance; the travel must not.
    sequence = sequence - np.mean(sequence)
    sequence *= params.rms_rad_s / np.sqrt(np.mean(sequence**2))
    return np.clip(params.mean_rad_s + sequence, -params.peak_rad_s, params.peak_rad_s)


def predicted_travel_rad(rate_rad_s: Array, sample_s: float) -> Pair:
    """Return how far a rate input carries the axis below and above its start, (<= 0, >= 0)."""
    require_between("sample_s", sample_s, 1e-6, None)
    path = np.cumsum(rate_rad_s) * sample_s
    return min(0.0, float(np.min(path))), max(0.0, float(np.max(path)))


def _multisine(params: ExcitationParams, random: "np.random.Generator") -> Array:
    """Return equal amplitudes on every line of the band with random phases, periodic."""
    frequency = np.fft.rfftfreq(params.samples, params.sample_s)
    # Whole lines of the sequence's own grid: the input is periodic and does not leak.
    spectrum = np.zeros(len(frequency), dtype=np.complex128)
    band = (frequency >= params.low_hz) & (frequency <= params.high_hz)
    spectrum[band] = np.exp(2j * np.pi * random.random(int(np.count_nonzero(band))))
    return np.fft.irfft(spectrum, params.samples)


@dataclass(frozen=True, slots=True)
class Recording:
    """Rate input (sequences, samples) of `axis` and encoder angles (sequences, samples, 2), rad."""

    axis: str
    sample_s: float
    input_rad_s: Array
    encoder_rad: Array

    def output_rad(self, axis: str) -> Array:
        """Return the encoder angles (sequences, samples) of one axis."""
        require_choice("axis", axis, AXES)
        return np.asarray(self.encoder_rad[:, :, AXES.index(axis)])


class IdentificationExperiment:
    """Call `command` once per sample until `finished`; then `recording` holds the sequences.

    `travel_rad` (low, high) bounds the driven axis; `margin_rad` is kept from both ends.
    """

    def __init__(
        self, params: ExcitationParams, axis: str, sequences: int, start_rad: float,
        travel_rad: Pair, random: "np.random.Generator", margin_rad: float = 0.01,
    ) -> None:  # fmt: skip
        require_choice("axis", axis, AXES)
        require_between("sequences", sequences, 1, 1000)
        require_between("margin_rad", margin_rad, 0.0, None)
        self._params, self._axis = params, AXES.index(axis)
        # Alternating sides keep the axis near its start, without a drive back between sequences.
        signs = np.where(np.arange(sequences) % 2 == 0, 1.0, -1.0)
        self._input = np.array([sign * excitation_rad_s(params, random) for sign in signs])
        self._low, self._high = travel_rad[0] + margin_rad, travel_rad[1] - margin_rad
        require_between("start_rad", start_rad, self._low, self._high)
        below, above = predicted_travel_rad(self._input.ravel(), params.sample_s)
        if start_rad + below < self._low or start_rad + above > self._high:
            raise ValueError(
                f"{axis} would run from {start_rad + below:.4f} to {start_rad + above:.4f} rad, "
                f"must stay within {self._low:.4f} and {self._high:.4f} rad"
            )
        self._encoder = np.zeros((*self._input.shape, 2))
        self.samples_taken, self._age_s = 0, 0.0
        self.abort_reason = ""
        """Why the experiment ended early, "" if it did not."""

    @property
    def sample_s(self) -> float:
        """Time between two commands."""
        return self._params.sample_s

    @property
    def peak_rad_s(self) -> float:
        """Largest rate of the whole input."""
        return float(np.max(np.abs(self._input)))

    @property
    def newest(self) -> tuple[Array, Array, float]:
        """The latest rate command (2,), the encoder angles (2,) at it, and their age in s.

        Raises ValueError before the first command.
        """
        if self.samples_taken == 0:
            raise ValueError("no sample has been taken")
        where = divmod(self.samples_taken - 1, self._input.shape[1])
        return self._rates(where), self._encoder[where].copy(), self._age_s

    @property
    def finished(self) -> bool:
        """Whether no further command follows: all samples taken, or aborted."""
        return bool(self.abort_reason) or self.samples_taken == self._input.size

    @property
    def progress(self) -> float:
        """Share of the samples taken, 0 to 1."""
        return self.samples_taken / self._input.size

    def abort(self, reason: str) -> None:
        """End the experiment; the next command is zero."""
        if not reason:
            raise ValueError("reason='' must say why the experiment ends")
        if not self.finished:
            self.abort_reason = reason

    def command(self, encoder_rad: ArrayLike, age_s: float = 0.0) -> Array:
        """Take encoder angles (2,) of that age; return the rate command (2,) until the next."""
        encoder = as_finite_array("encoder_rad", encoder_rad, (2,))
        # The predicted travel is that of a perfect antenna: wind or a slipping drive may leave it.
        if not self._low <= encoder[self._axis] <= self._high:
            self.abort(f"{AXES[self._axis]} {encoder[self._axis]:.6f} rad left {self._low:.6f} to {self._high:.6f} rad")
        rate = np.zeros(2)
        # After the end the antenna is commanded to rest, not to its last rate.
        if self.finished:
            return rate
        where = divmod(self.samples_taken, self._input.shape[1])
        self._encoder[where], self._age_s = encoder, age_s
        self.samples_taken += 1
        return self._rates(where)

    def recording(self) -> Recording:
        """Return the sequences that were completed; ValueError if not even one was."""
        # A sequence that was cut off has lost its spectrum: only complete ones count.
        complete = self.samples_taken // self._input.shape[1]
        if complete == 0:
            raise ValueError(f"no sequence is complete: {self.samples_taken} of {self._input.shape[1]} samples taken")
        return Recording(
            AXES[self._axis], self._params.sample_s, self._input[:complete].copy(), self._encoder[:complete].copy()
        )

    def _rates(self, where: tuple[int, int]) -> Array:
        rates = np.full(2, self._params.idle_rate_rad_s)
        rates[self._axis] = self._input[where]
        return rates


ON_TIME_S, SHORTEST_S = 1e-5, 1e-3
"""How far a sample may be from its time to be taken as it is; least time to the next."""
MOST_STRETCH = 0.1
"""Largest share by which a sequence may take longer, or shorter, than its samples say."""


class SampleCollector:
    """Samples of one experiment on `axis`: `sequences` of `samples`, `sample_s` apart."""

    def __init__(self, axis: str, sequences: int, samples: int, sample_s: float) -> None:
        require_choice("axis", axis, AXES)
        require_between("sequences", sequences, 1, 1000)
        require_between("samples", samples, 1, None)
        self._axis, self._sample_s = axis, sample_s
        self._input = np.zeros((sequences, samples))
        self._encoder = np.zeros((sequences, samples, 2))
        self._received = np.zeros((sequences, samples), dtype=bool)
        self._t_s = np.full((sequences, samples), np.nan)
        self._age_s = np.zeros((sequences, samples))

    @property
    def received(self) -> int:
        """Number of samples taken."""
        return int(np.count_nonzero(self._received))

    def take(
        self, t_s: float, axis: str, sample: int, rate_rad_s: ArrayLike, position_rad: ArrayLike, age_s: float = 0.0
    ) -> None:
        """Take sample number `sample` (from 0) of `t_s`: rate command (2,) and encoder angles (2,).

        The angles were measured `age_s` before.  Raises ValueError for another axis, a number that
        is outside or was taken before, or a non-finite value.
        """
        if axis != self._axis:
            raise ValueError(f"axis={axis!r} must be {self._axis!r}, the axis of this experiment")
        require_between("sample", sample, 0, self._received.size - 1)
        # Samples may arrive in any order: the number says where each belongs.
        where = divmod(sample, self._received.shape[1])
        # A sample may come twice over the wire; the second would hide a wrong number.
        if self._received[where]:
            raise ValueError(f"sample={sample} was taken before")
        rate = as_finite_array("rate_rad_s", rate_rad_s, (2,))
        require_between("age_s", age_s, 0.0, None)
        self._encoder[where] = as_finite_array("position_rad", position_rad, (2,))
        self._input[where] = rate[AXES.index(axis)]
        self._received[where], self._t_s[where], self._age_s[where] = True, t_s, age_s

    def _on_time(self) -> tuple[BoolArray, str]:
        """Return which sequences are on time, and words about the others."""
        wanted_s, took_s = self._sample_s * (self._t_s.shape[1] - 1), self._t_s[:, -1] - self._t_s[:, 0]
        late = np.abs(took_s - wanted_s) > MOST_STRETCH * wanted_s
        late |= np.any(np.diff(self._t_s, axis=1) <= 0.0, axis=1)
        words = (
            f"{np.count_nonzero(late)} of {len(late)} sequences took up to {np.max(took_s[late], initial=0.0):.1f} s, "
            f"must be {wanted_s:.1f} s within 10 %: the antenna missed ticks, its computer was busy"
        )
        return ~late, words if np.any(late) else ""

    @property
    def late(self) -> str:
        """Which sequences were not on time, "" if all were."""
        return self._on_time()[1]

    def recording(self) -> tuple[Recording, int]:
        """Return the sequences that are complete and on time, and how many samples are missing.

        Of one that was not on time the input is another than was made.  Raises ValueError if no
        sequence is left.
        """
        on_time, late = self._on_time()
        complete = np.all(self._received, axis=1) & on_time
        if not np.any(complete):
            taken = f"no sequence is complete: {self.received} of {self._received.size} samples taken"
            raise ValueError("; ".join(filter(None, (taken, late))))
        missing = int(np.count_nonzero(~self._received))
        even = [self._evened(number) for number in np.flatnonzero(complete).tolist()]
        return Recording(self._axis, self._sample_s, *map(np.array, zip(*even, strict=True))), missing

    def _evened(self, number: int) -> tuple[Array, Array]:
        """Return inputs (n,) and angles (n, 2) of a sequence as if each had come at its time.

        The mean age stays in them: a loop that runs on such angles has it too.
        """
        # Imported here: the antenna's node makes no recordings.
        from scipy.interpolate import CubicSpline

        rate, encoder = self._input[number], self._encoder[number]
        since_s = self._t_s[number] - self._t_s[number, 0]
        aged_s = self._age_s[number] - np.mean(self._age_s[number])
        grid_s = self._sample_s * np.arange(len(rate))
        if max(np.max(np.abs(since_s - grid_s)), np.max(np.abs(aged_s))) < ON_TIME_S:
            return rate, encoder
        # Each input lasts until the next one; what counts is its mean over a sample.
        ends_s = np.append(grid_s, grid_s[-1] + self._sample_s)
        until_s = np.append(since_s, max(since_s[-1], ends_s[-1]))
        turned_rad = np.append(0.0, np.cumsum(rate * np.diff(until_s)))
        mean = np.diff(np.interp(ends_s, until_s, turned_rad)) / self._sample_s
        measured_s = since_s - aged_s
        order = np.argsort(measured_s)
        # The newest sample of a device may serve two commands; the wire rounds its time in each.
        order = order[np.append(True, np.diff(measured_s[order]) > SHORTEST_S)]
        known_s = measured_s[order]
        angles = CubicSpline(known_s, encoder[order])(np.clip(grid_s, known_s[0], known_s[-1]))
        return mean, angles
