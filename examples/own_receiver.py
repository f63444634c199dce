"""A receiver of one's own: what `signal_receiver` needs to take its samples or levels.

Put it into a package of yours and register it there (setup.cfg), then set
`receiver: {type: own_receiver}` in the station description:

    [options.entry_points]
    rf_pointing.receivers =
        own_receiver = my_package.own_receiver:OwnReceiver

`Radio` takes the place of your device's driver.  `open`, `read` and `close` run in a thread of
their own and may wait; `scripts/run check_receiver` says what is still missing.
"""

import time
from collections.abc import Sequence

import numpy as np

from rf_pointing.receiver import IqSamples, Source

PIECE_S = 0.02


class Radio:
    """A device that delivers a carrier 5 kHz above its centre, in noise."""

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz, self.count, self.begun_s = rate_hz, 0, time.monotonic()
        self.noise = np.random.default_rng(1)

    def receive(self) -> np.ndarray:
        count = int(PIECE_S * self.rate_hz)
        due_s = self.begun_s + (self.count + count) / self.rate_hz
        time.sleep(max(0.0, due_s - time.monotonic()))
        turns = 5e3 * (self.count + np.arange(count)) / self.rate_hz % 1.0
        self.count += count
        noise = self.noise.standard_normal((count, 2)) @ [1.0, 1j]
        return (0.02 * np.exp(2j * np.pi * turns) + 0.05 * noise).astype(np.complex64)


class OwnReceiver(Source):
    """Samples of one channel without time stamps; `self.iq` counts and stamps them."""

    def open(self) -> None:
        # OSError says why the device cannot be opened; it is tried again.
        self.radio = Radio(self.params.iq.rate_hz)

    def read(self) -> Sequence[IqSamples]:
        # At most 0.1 s; () for nothing.  A device of levels returns (Level(self.now_s(), value),).
        samples = self.radio.receive()
        return (self.iq(samples[None, :]),)

    def close(self) -> None:
        """Release the device."""
