"""CasADi functions called on numpy arrays without copies through CasADi's own matrix class."""

from __future__ import annotations

import casadi as ca
import numpy as np

from radiation_ss.arrays import FloatArray

BUCKET = 128


class Compiled:
    """A CasADi function mapped over samples, with arrays [sample, column, row] in and out.

    Parameters
    ----------
    function : casadi.Function
        One output; dense.
    count : int
        Number of samples.
    accumulate : bool
        Feed the result back as the first input (mapaccum) instead of mapping.

    Notes
    -----
    CasADi stores matrices by columns, so [sample, column, row] in C order is its memory as it stands.
    """

    def __init__(self, function: ca.Function, count: int, *, accumulate: bool = False) -> None:
        # Making a map costs as much as calling it, so alike lengths share one.
        self.count = -(-count // BUCKET) * BUCKET
        self.function = function.mapaccum(self.count) if accumulate else function.map(self.count)
        rows, columns = function.size1_out(0), function.size2_out(0)
        self.result = np.empty((self.count, columns, rows))
        self.inputs = []
        for k in range(function.n_in()):
            repeat = 1 if accumulate and k == 0 else self.count
            self.inputs.append(np.zeros((repeat, function.size2_in(k), function.size1_in(k))))
        self.buffer, self.call = self.function.buffer()
        for k, values in enumerate(self.inputs):
            self.buffer.set_arg(k, memoryview(values))  # type: ignore[call-arg, arg-type]
        self.buffer.set_res(0, memoryview(self.result))  # type: ignore[call-arg, arg-type]

    def __call__(self, count: int, *arguments: FloatArray | float) -> FloatArray:
        """Return the results of `count` samples, shape (count, columns, rows); a fresh array.

        Arguments broadcast to (count, columns, rows) of their input.
        """
        for target, values in zip(self.inputs, arguments):
            target[:count] = values
        self.call()
        return self.result[:count].copy()

