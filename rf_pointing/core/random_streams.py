"""One seed for a whole run: every noise source draws from its own stream, named after itself.

The stream depends on the seed and on the name only, so adding a noise source changes none of the
others.
"""

import zlib

import numpy as np


def random_stream(seed: int, name: str) -> "np.random.Generator":
    """Return the generator of the noise source `name` in the run with `seed`."""
    # SeedSequence takes no negative numbers, and says so in words that name no parameter.
    if seed < 0:
        raise ValueError(f"seed={seed} must be >= 0")
    # crc32, not hash(): a string's hash differs from process to process.
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence([seed, zlib.crc32(name.encode())]))
    )
