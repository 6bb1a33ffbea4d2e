"""Evaluation of the equations of motion in compiled code; `steps` integrates them.

Compiled once for all models: the equations come as lists of CasADi's instructions, from `compiled.Compiled`; codes
are positions in `compiled.OPERATIONS`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.jit import jit


@jit
def elementary(code: int, a: float, b: float) -> float:
    """Return the value of one operation; those of one operand ignore the second."""
    if code == 9:
        return 1.0 / a
    if code == 11:
        return math.sin(a)
    if code == 12:
        return math.cos(a)
    if code == 13:
        return math.tanh(a)
    if code == 14:
        return math.exp(a)
    if code == 15:
        return math.sqrt(a)
    if code == 16:
        return abs(a)
    if code == 17:
        return (1.0 if a > 0.0 else 0.0) - (1.0 if a < 0.0 else 0.0)
    if code == 18:
        return 1.0 if a < b else 0.0
    if code == 19:
        return 1.0 if a <= b else 0.0
    if code == 20:
        return 1.0 if a == b else 0.0
    if code == 21:
        return 1.0 if a != b else 0.0
    if code == 22:
        return 1.0 if a == 0.0 else 0.0
    if code == 23:
        return 1.0 if a != 0.0 and b != 0.0 else 0.0
    if code == 24:
        return 1.0 if a != 0.0 or b != 0.0 else 0.0
    if code == 25:
        return min(a, b)
    if code == 26:
        return max(a, b)
    if code == 27 or code == 28:
        return a**b
    return seldom(code, a, b)


@jit
def seldom(code: int, a: float, b: float) -> float:
    """Return the value of an operation that few effects hold."""
    if code == 29:
        return math.log(a)
    if code == 30:
        return math.tan(a)
    if code == 31:
        return math.asin(a)
    if code == 32:
        return math.acos(a)
    if code == 33:
        return math.atan(a)
    if code == 34:
        return math.atan2(a, b)
    if code == 35:
        return math.sinh(a)
    if code == 36:
        return math.cosh(a)
    if code == 37:
        return math.asinh(a)
    if code == 38:
        return math.acosh(a)
    if code == 39:
        return math.atanh(a)
    if code == 40:
        return float(np.floor(a))
    if code == 41:
        return float(np.ceil(a))
    if code == 42:
        return float(np.fmod(a, b))
    if code == 43:
        return math.copysign(a, b)
    if code == 44:
        return math.erf(a)
    if code == 45:
        return math.log1p(a)
    if code == 46:
        return math.expm1(a)
    if code == 47:
        return math.hypot(a, b)
    return a


@jit
def evaluate(instructions: NDArray[np.int64], work: FloatArray, x: FloatArray, result: FloatArray) -> None:
    """Run the instructions once, from x to result."""
    for k in range(instructions.shape[0]):
        code, out, one, two = instructions[k, 0], instructions[k, 1], instructions[k, 2], instructions[k, 3]
        if code == 0:
            work[out] = x[one]
        elif code == 1:
            result[out] = work[one]
        elif code == 2:
            work[out] = work[one] + work[two]
        elif code == 3:
            work[out] = work[one] - work[two]
        elif code == 4:
            work[out] = work[one] * work[two]
        elif code == 5:
            work[out] = work[one] / work[two]
        elif code == 6:
            work[out] = -work[one]
        elif code == 7:
            work[out] = work[one] * work[one]
        elif code == 8:
            work[out] = 2.0 * work[one]
        elif code == 10:
            work[out] = work[two] if work[one] != 0.0 else 0.0
        else:
            work[out] = elementary(code, work[one], work[two])


@jit
def copy(source: FloatArray, target: FloatArray) -> None:
    """Copy numbers; a loop, as an assignment of slices takes seconds to compile."""
    for i in range(source.size):
        target[i] = source[i]


@jit
def recur(instructions: NDArray[np.int64], work: FloatArray, rows: FloatArray, result: FloatArray) -> FloatArray:
    """Run the instructions for every row, the last result before it; return all results, zero first."""
    count, size = rows.shape[0], result.size
    x, found = np.empty(size + rows.shape[1]), np.zeros((count + 1, size))
    for k in range(count):
        copy(found[k], x[:size])
        copy(rows[k], x[size:])
        evaluate(instructions, work, x, result)
        copy(result, found[k + 1])
    return found


@jit
def run_linear(F: FloatArray, x: FloatArray) -> None:
    """Add F x_(k-1) to each row x_k but the first, in turn."""
    for k in range(1, x.shape[0]):
        for i in range(x.shape[1]):
            total = x[k, i]
            for j in range(x.shape[1]):
                total += F[i, j] * x[k - 1, j]
            x[k, i] = total


@jit
def run_modes(real: np.ndarray, imag: np.ndarray, w: np.ndarray, z: np.ndarray) -> None:
    """Run z = pole z + w_k for every mode, in place: w becomes the states after each step, z the last one.

    Two modes go side by side, since a single recursion waits for its own result. real, imag (modes,), an even number,
    are the poles; w (2 modes, nt) and z (2 modes,) have real parts, then imaginary parts.
    """
    modes = real.size
    for m in range(0, modes, 2):
        n = m + 1
        a, b, x, y = real[m], imag[m], z[m], z[modes + m]
        c, d, p, q = real[n], imag[n], z[n], z[modes + n]
        for k in range(w.shape[1]):
            x, y = a * x - b * y + w[m, k], a * y + b * x + w[modes + m, k]
            p, q = c * p - d * q + w[n, k], c * q + d * p + w[modes + n, k]
            w[m, k], w[modes + m, k], w[n, k], w[modes + n, k] = x, y, p, q
        z[m], z[modes + m], z[n], z[modes + n] = x, y, p, q
