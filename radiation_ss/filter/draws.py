"""Random draws for the compiled loops, from a numpy.random.Generator: Gaussian, or three points.

Three-point draws are -sqrt(3), 0, sqrt(3) with probabilities 1/6, 2/3, 1/6: they match the Gaussian's first five
moments, which is all that a covariance and its sampling error see.
"""

from __future__ import annotations

import numpy as np

from radiation_ss.jit import jit


@jit
def fill_gaussian(rng, out):  # type: ignore[no-untyped-def]
    """Fill a flat array with standard normal draws."""
    for i in range(out.size):
        out[i] = rng.standard_normal()


@jit
def fill_three_point(rng, out):  # type: ignore[no-untyped-def]
    """Fill a flat array with three-point draws, three from each uniform draw of 51 bits; 1/6 is off by 3e-6."""
    root3, sixth = np.sqrt(3.0), 2**17 // 6
    for i in range(0, out.size, 3):
        bits = np.int64(rng.random() * 2.0**51)
        for k in range(min(3, out.size - i)):
            v = bits & 0x1FFFF
            out[i + k] = (root3 if v >= 2**17 - sixth else 0.0) - (root3 if v < sixth else 0.0)
            bits >>= 17
