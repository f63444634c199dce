"""Cost of the receiver: seconds of a core per second of a 2.4-Msample/s stream, beside its bare FFT.

    scripts/run-python benchmarks/receiver.py [--seconds 10]

The samples are made before the clock runs.  `rtl_tcp` takes bytes as they come from the socket, the
other rows float samples; the bare FFT is scipy's of the same blocks.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np
import scipy.fft

from rf_pointing.receiver import GeneratorParams, IqSamples, SignalGenerator, SignalMeter, SignalReceiverParams
from rf_pointing.receiver.iq_sources import decoded
from rf_pointing.receiver.params import IqParams, SignalSearchParams
from rf_pointing.receiver.spectrum import Layout

RATE_HZ, PIECE = 2.4e6, 48000
OFFSET_HZ = 1e5


def main() -> None:
    """Print a table of the costs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0)
    seconds = parser.parse_args().seconds
    generator = SignalGenerator(GeneratorParams(rate_hz=RATE_HZ))
    pieces = [generator.take(PIECE, (OFFSET_HZ, OFFSET_HZ), [1e3]) for _ in range(50)]
    texts = [
        np.clip(np.rint(piece.view(np.float32) * 128 + 127.5), 0, 255).astype(np.uint8).tobytes() for piece in pieces
    ]
    count = int(seconds * RATE_HZ / PIECE)

    def meter(kind: str) -> SignalMeter:
        return SignalMeter(SignalReceiverParams(
            type="rtl_tcp", frequency_hz=2.25e9, iq=IqParams(rate_hz=RATE_HZ, centre_mhz=2250.0 - 1e-6 * OFFSET_HZ),
            signal=SignalSearchParams(kind=kind),
        ))  # fmt: skip

    def cost(take: Callable[[int], object]) -> float:
        begun_s = time.process_time()
        for number in range(count):
            take(number)
        return (time.process_time() - begun_s) / seconds

    def through(kind: str, text: bool) -> Callable[[int], object]:
        subject = meter(kind)

        def take(number: int) -> object:
            piece = decoded(texts[number % 50], "cu8")[0] if text else pieces[number % 50]
            return subject.take(IqSamples(piece, RATE_HZ, number * PIECE, 1e3 + (number + 1) * PIECE / RATE_HZ))

        return take

    layout = Layout.of_rate(RATE_HZ)
    block = np.concatenate(pieces, axis=1)[:, : layout.block]
    blocks = int(seconds * RATE_HZ / layout.hop)
    begun_s = time.process_time()
    for _ in range(blocks):
        scipy.fft.fft(block, axis=1)
    bare = (time.process_time() - begun_s) / seconds
    print(f"bare FFT, {layout.block} points every {layout.hop}: {100.0 * bare:5.1f} % of a core")
    for name, take in (("carrier, float", through("carrier", False)), ("carrier, rtl_tcp", through("carrier", True)),
                       ("band, rtl_tcp", through("band", True))):  # fmt: skip
        spent = cost(take)
        print(f"{name:<20} {100.0 * spent:5.1f} % of a core, {spent / bare:.1f} times the bare FFT")


if __name__ == "__main__":
    main()
