"""Random draws for the compiled loops: a counter, a mixer, Gaussian or three-point values.

numba compiles numpy.random.Generator, too. With it a run of the paper's filter takes 1.5 times as long with Gaussian
and 3 times as long with three-point draws (docs/validation/filter_speed.md): bits made one by one are not vectorised.

SplitMix64 (Steele, Lea, Flood 2014) is a counter and a hash, so the state of the generator is one integer: it is
saved exactly, and a run's draws depend on nothing but its seed. Gaussian draws by the ziggurat (Marsaglia and Tsang
2000, in the form of Doornik 2005). Three-point draws are -sqrt(3), 0, sqrt(3) with probabilities 1/6, 2/3, 1/6: they
match the Gaussian's first five moments, which is all that a covariance and its sampling error see.
"""

from __future__ import annotations

import numpy as np

from radiation_ss.jit import jit

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
MIX1, MIX2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
S11, S16, S27, S30, S31 = (np.uint64(k) for k in (11, 16, 27, 30, 31))
LAYER, LANE = np.uint64(127), np.uint64(0xFFFF)
I11 = np.int64(11)
UNIT, HALF_UNIT = 2.0**-53, 2.0**-52
BLOCK = 4096
SIXTH = np.int64(10923)          # 65536 / 6
ROOT3 = 3.0**0.5
TAIL, AREA = 3.442619855899, 9.91256303526217e-3


def _layers() -> tuple[np.ndarray, np.ndarray]:
    edge = np.zeros(129)
    density = np.exp(-0.5 * TAIL**2)
    edge[0], edge[1] = AREA / density, TAIL
    for i in range(2, 128):
        density = AREA / edge[i - 1] + density
        edge[i] = np.sqrt(-2.0 * np.log(density))
    return edge, edge[1:] / edge[:-1]


EDGE, RATIO = _layers()


def seeded(seed: int | np.random.SeedSequence) -> np.ndarray:
    """Return the state of a generator, shape (1,), uint64."""
    sequence = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
    return sequence.generate_state(1, np.uint64)


@jit(inline="always")
def _next(state):  # type: ignore[no-untyped-def]
    state[0] += GOLDEN
    x = state[0]
    x = (x ^ (x >> S30)) * MIX1
    x = (x ^ (x >> S27)) * MIX2
    return x ^ (x >> S31)


@jit(inner=True)
def _outside(state, layer, u):  # type: ignore[no-untyped-def]
    """Return (accepted, value) for a draw that fell outside its layer's core."""
    if layer == 0:
        while True:
            x = np.log(1.0 - (_next(state) >> S11) * UNIT) / TAIL
            y = np.log(1.0 - (_next(state) >> S11) * UNIT)
            if -2.0 * y >= x * x:
                return True, (x - TAIL if u < 0.0 else TAIL - x)
    x = u * EDGE[layer]
    high = np.exp(-0.5 * (EDGE[layer] * EDGE[layer] - x * x))
    low = np.exp(-0.5 * (EDGE[layer + 1] * EDGE[layer + 1] - x * x))
    return low + (_next(state) >> S11) * UNIT * (high - low) < 1.0, x


@jit(inner=True)
def _bits(start, out):  # type: ignore[no-untyped-def]
    """Fill an array with the random bits that follow a counter."""
    for i in range(out.size):
        x = start + GOLDEN * np.uint64(i + 1)
        x = (x ^ (x >> S30)) * MIX1
        x = (x ^ (x >> S27)) * MIX2
        out[i] = x ^ (x >> S31)


@jit
def fill_gaussian(state, out):  # type: ignore[no-untyped-def]
    """Fill a flat array with standard normal draws: all at once inside the layers' cores, then the 2.4 % outside."""
    bits = np.empty(min(out.size, BLOCK), dtype=np.uint64)
    for start in range(0, out.size, BLOCK):
        part = out[start:start + BLOCK]
        block = bits[:part.size]
        _bits(state[0], block)
        state[0] += GOLDEN * np.uint64(part.size)
        for i in range(part.size):
            u = np.float64(np.int64(block[i]) >> I11) * HALF_UNIT
            part[i] = u * EDGE[block[i] & LAYER]
        for i in range(part.size):
            layer = np.int64(block[i] & LAYER)
            u = np.float64(np.int64(block[i]) >> I11) * HALF_UNIT
            accepted = abs(u) < RATIO[layer]
            while not accepted:
                accepted, part[i] = _outside(state, layer, u)
                if not accepted:
                    again = _next(state)
                    layer, u = np.int64(again & LAYER), np.float64(np.int64(again) >> I11) * HALF_UNIT
                    accepted = abs(u) < RATIO[layer]
                    part[i] = u * EDGE[layer]


@jit
def fill_three_point(state, out):  # type: ignore[no-untyped-def]
    """Fill a flat array with three-point draws, four from each 64 random bits."""
    bits = np.empty((min(out.size, BLOCK) + 3) // 4, dtype=np.uint64)
    for start in range(0, out.size, BLOCK):
        part = out[start:start + BLOCK]
        block = bits[:(part.size + 3) // 4]
        _bits(state[0], block)
        state[0] += GOLDEN * np.uint64(block.size)
        for lane in range(4):
            values, shift = part[lane * block.size:(lane + 1) * block.size], S16 * np.uint64(lane)
            for i in range(values.size):
                v = np.int64((block[i] >> shift) & LANE)
                values[i] = (ROOT3 if v >= 65536 - SIXTH else 0.0) - (ROOT3 if v < SIXTH else 0.0)
