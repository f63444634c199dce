"""Memory of a receiver: ten minutes of samples at full speed, then every fault of its source 50 times.

    scripts/run-python benchmarks/receiver_memory.py [--minutes 10] [--rounds 50]

The samples, 2.4 Msample/s, go through the meter as fast as it takes them, as a carrier and as a
band.  The faults pass over real sockets in the time of the script: rtl_tcp killed, stalled for 5 s,
garbage, half the rate, clipped; DIFI 1e9 samples late, retuned.  After each the level must be back.
Wanted: less than 1 MB more than after a first minute, and than after the first five rounds.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from real_station import of_tests

from rf_pointing.receiver import (
    GeneratorParams,
    IqSamples,
    SignalGenerator,
    SignalReceiver,
    SignalReceiverParams,
    Source,
)  # fmt: skip
from rf_pointing.receiver.params import IqParams, SignalSearchParams

lines = of_tests("receiver/test_sources.py")

RATE_HZ, PIECE, OFFSET_HZ = 2.4e6, 48000, 1e5
GROWTH_MB, SETTLED_ROUNDS, BACK_DB = 1.0, 5, 0.5
FAULT_S, BACK_S, LATE_S = 1.5, 2.5, 1e9 / RATE_HZ


def megabytes() -> float:
    """Return the memory of this process."""
    return int(Path("/proc/self/status").read_text().split("RssAnon:")[1].split()[0]) / 1024.0


class Fed(Source):
    """A source of the pieces that it is given."""

    def __init__(self, params: SignalReceiverParams, pieces: Sequence[Any]) -> None:
        self.t_s, self._pieces, self._count = 1e3, pieces, 0
        super().__init__(params, lambda: self.t_s)

    def step(self) -> list[IqSamples]:
        self.t_s += PIECE / RATE_HZ
        self._count, self.problem = self._count + 1, ""
        return [self.iq(self._pieces[self._count % len(self._pieces)], t_s=self.t_s - PIECE / RATE_HZ)]


def flow(kind: str, minutes: int) -> float:
    """Return the growth over minutes of samples, from the first one on."""
    generator = SignalGenerator(GeneratorParams(rate_hz=RATE_HZ, modulation="cw" if kind == "carrier" else "qpsk"))
    pieces = [generator.take(PIECE, (OFFSET_HZ, OFFSET_HZ), [1e3]) for _ in range(50)]
    params = SignalReceiverParams(
        type="rtl_tcp", frequency_hz=2.25e9, signal=SignalSearchParams(kind=kind),
        iq=IqParams(rate_hz=RATE_HZ, centre_mhz=2250.0 - 1e-6 * OFFSET_HZ),
    )  # fmt: skip
    source = Fed(params, pieces)
    receiver, first = SignalReceiver(params, source.now_s, source), 0.0
    for minute in range(minutes + 1):
        for _ in range(round(60.0 * RATE_HZ / PIECE)):
            receiver.step(source.t_s)
        first = first or megabytes()
        print(f"{kind}, minute {minute + 1}: {megabytes():.2f} MB", flush=True)
    assert receiver.newest is not None
    return megabytes() - first


def garbage(line: Any) -> None:
    random = np.random.default_rng(1)
    for _ in range(round(FAULT_S / lines.PIECE_S)):
        samples = random.uniform(-1.0, 1.0, 2 * round(lines.PIECE_S * lines.RATE_HZ)).astype(np.float32)
        send(line, samples.view(np.complex64)[None, :])


def half_rate(line: Any) -> None:
    for _ in range(round(FAULT_S / lines.PIECE_S)):
        count = round(0.5 * lines.PIECE_S * lines.RATE_HZ)
        offset_hz = lines.CARRIER_HZ - lines.CENTRE_HZ
        send(line, line.generator.take(count, (offset_hz, offset_hz), [10.0 ** (lines.LEVEL_DB_HZ / 20.0)]))


def send(line: Any, samples: Any) -> None:
    begin_s, line.t_s = line.t_s, line.t_s + lines.PIECE_S
    before = line.receiver.source.index
    line.outlet.send(samples, begin_s)
    lines.wait_for(lambda: line.receiver.source.index >= before + samples.shape[1], "samples")
    line.receiver.step(line.t_s)


def kill(line: Any) -> None:
    line.outlet.close()
    lines.wait_for(lambda: f"{line.kind} at" in line.problem(), "a problem")
    line.stall(1.0)
    line.outlet = line.open_outlet()
    line.connect()


def retune(line: Any) -> None:
    line.outlet.centre_hz = lines.CENTRE_HZ - 5e3
    line.run(FAULT_S)
    line.outlet.centre_hz = lines.CENTRE_HZ


Fault = Callable[[Any], object]
FAULTS: dict[str, dict[str, Fault]] = {
    "rtl_tcp": {
        "killed": kill,
        "stalled": lambda line: line.stall(5.0),
        "garbage": garbage,
        "half the rate": half_rate,
        "clipped": lambda line: line.run(FAULT_S, gain=300.0),
    },
    "vita49": {"late": lambda line: line.run(FAULT_S, shift_s=-LATE_S), "retuned": retune},
}


def disturbed(kind: str, rounds: int) -> tuple[float, list[str]]:
    """Return the growth over the rounds from the fifth on, and what did not come back."""
    first, lost = 0.0, list[str]()
    with closing(lines.Line(kind)) as line:
        line.connect()
        for round_ in range(rounds):
            for name, fault in FAULTS[kind].items():
                fault(line)
                line.measured.clear()
                line.run(BACK_S)
                level = np.median([each.power.carrier_to_noise_db_hz for each in line.measured[-5:]] or [0.0])
                if abs(level - lines.LEVEL_DB_HZ) > BACK_DB:
                    lost.append(f"{name} in round {round_ + 1}: {level:.1f} dB-Hz, {line.problem()}")
                line.measured.clear()
            if round_ + 1 == min(SETTLED_ROUNDS, rounds):
                first = megabytes()
        return megabytes() - first, lost


def main() -> int:
    """Print the memory; 1 where it grows or a level does not come back."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=50)
    options = parser.parse_args()
    good = True
    for kind in ("carrier", "band") if options.minutes else ():
        grown = flow(kind, options.minutes)
        good &= grown < GROWTH_MB
        print(f"{kind}: {grown:+.2f} MB in {options.minutes} min of samples", flush=True)
    for kind, faults in FAULTS.items() if options.rounds else ():
        grown, lost = disturbed(kind, options.rounds)
        good &= grown < GROWTH_MB and not lost
        print(f"{kind}: {grown:+.2f} MB in {options.rounds} rounds of {', '.join(faults)}", *lost, sep="\n", flush=True)
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
