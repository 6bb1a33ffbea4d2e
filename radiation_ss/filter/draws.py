"""Random draws for the compiled loops: a counter, a mixer, Gaussian or three-point values.

SplitMix64 (Steele, Lea, Flood 2014) is a counter and a hash, so the state of the generator is one integer: it is
saved exactly, and a run's draws depend on nothing but its seed. Gaussian draws by the ziggurat (Marsaglia and Tsang
2000, in the form of Doornik 2005). Three-point draws are -sqrt(3), 0, sqrt(3) with probabilities 1/6, 2/3, 1/6: they
match the Gaussian's first five moments, which is all that a covariance and its sampling error see.
"""

from __future__ import annotations

import numpy as np

from radiation_ss.filter.jit import jit

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
MIX1, MIX2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
S7, S11, S16, S27, S30, S31 = (np.uint64(k) for k in (7, 11, 16, 27, 30, 31))
LAYER, LANE = np.uint64(127), np.uint64(0xFFFF)
UNIT = 1.0 / 9007199254740992.0  # 2^-53
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


@jit
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


@jit
def fill_gaussian(state, out):  # type: ignore[no-untyped-def]
    """Fill a flat array with standard normal draws."""
    i = 0
    while i < out.size:
        bits = _next(state)
        u = 2.0 * ((bits >> S11) * UNIT) - 1.0
        layer = np.int64(bits & LAYER)
        if abs(u) < RATIO[layer]:
            out[i] = u * EDGE[layer]
            i += 1
        else:
            accepted, x = _outside(state, layer, u)
            if accepted:
                out[i] = x
                i += 1


@jit
def fill_three_point(state, out):  # type: ignore[no-untyped-def]
    """Fill a flat array with three-point draws, four from each 64 random bits."""
    start, blocks = state[0], (out.size + 3) // 4
    for b in range(out.size // 4):
        x = start + GOLDEN * np.uint64(b + 1)
        x = (x ^ (x >> S30)) * MIX1
        x = (x ^ (x >> S27)) * MIX2
        x = x ^ (x >> S31)
        for lane in range(4):
            v = np.int64((x >> (S16 * np.uint64(lane))) & LANE)
            out[4 * b + lane] = ROOT3 * (np.float64(v >= 65536 - SIXTH) - np.float64(v < SIXTH))
    state[0] = start + GOLDEN * np.uint64(out.size // 4)
    if blocks * 4 != out.size:
        x = _next(state)
        for lane in range(out.size % 4):
            v = np.int64((x >> (S16 * np.uint64(lane))) & LANE)
            out[out.size // 4 * 4 + lane] = ROOT3 * (np.float64(v >= 65536 - SIXTH) - np.float64(v < SIXTH))
