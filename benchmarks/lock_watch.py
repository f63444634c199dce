"""How often a right lock is doubted, and how fast a flipped sign is found.

    scripts/run-python benchmarks/lock_watch.py [PASSES]

Passes of ten minutes at Ka, 45 dB-Hz, wind 8 m/s, and as many flips under a beam at rest in each of both bands; takes about
two minutes a pass.  The exit status says whether a lock was doubted.
"""

import sys

from rf_pointing.core import MDEG
from rf_pointing.papers.autotrack import doubted_passes, flip_found_s

FIRST_SEED = 101


def main() -> int:
    """Print the times and the count; return 1 if a right lock was handed back."""
    passes = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for band in ("Ka", "X"):
        for seed in range(FIRST_SEED, FIRST_SEED + passes):
            found_s, error_rad = flip_found_s(band, seed)
            print(f"{band} flip, seed {seed}: {found_s:.2f} s, {error_rad / MDEG:.2f} mdeg", flush=True)
    doubted = 0
    for seed in range(FIRST_SEED, FIRST_SEED + passes):
        doubted += doubted_passes([seed])
        print(f"{doubted} of {seed - FIRST_SEED + 1} passes doubted", flush=True)
    return int(doubted > 0)


if __name__ == "__main__":
    sys.exit(main())
