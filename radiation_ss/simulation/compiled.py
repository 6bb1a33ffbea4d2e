"""CasADi functions called on numpy arrays without copies through CasADi's own matrix class."""

from __future__ import annotations

import casadi as ca
import numpy as np

from radiation_ss.arrays import FloatArray

CHUNK = 128  # samples of one call: making a long map takes longer than calling it


class Compiled:
    """A CasADi function mapped over samples, with arrays [sample, column, row] in and out.

    Parameters
    ----------
    function : casadi.Function
        Dense outputs; parameters as the last input.
    accumulate : bool
        Feed the first result back as the first input (mapaccum) instead of mapping.

    Notes
    -----
    CasADi stores matrices by columns, so [sample, column, row] in C order is its memory as it stands. What depends on
    parameters alone is evaluated once for all samples.
    """

    def __init__(self, function: ca.Function, *, accumulate: bool = False) -> None:
        self.accumulate = accumulate
        function, self.fixed = without_fixed(function)
        self.function = function.mapaccum(CHUNK) if accumulate else function.map(CHUNK)
        self.results = [np.empty((CHUNK, function.size2_out(k), function.size1_out(k)))
                        for k in range(function.n_out())]
        self.inputs = []
        for k in range(function.n_in()):
            repeat = 1 if accumulate and k == 0 else CHUNK
            self.inputs.append(np.zeros((repeat, function.size2_in(k), function.size1_in(k))))
        self.buffer, self.call = self.function.buffer()
        for k, values in enumerate(self.inputs):
            self.buffer.set_arg(k, memoryview(values))  # type: ignore[call-arg, arg-type]
        for k, values in enumerate(self.results):
            self.buffer.set_res(k, memoryview(values))  # type: ignore[call-arg, arg-type]

    def all(self, count: int, *arguments: FloatArray | float) -> list[FloatArray]:
        """Return every output of `count` samples, shapes (count, columns, rows); fresh arrays.

        An argument of three axes has a sample on the first; any other is the same for all samples. With
        `accumulate` the first argument is where the first sample starts from.
        """
        found = [np.empty((count, *values.shape[1:])) for values in self.results]
        varying = []
        for k, values in enumerate(arguments):
            if k == len(arguments) - 1 and self.fixed is not None:
                self.inputs[k][:] = np.asarray(self.fixed(values)).T
            elif np.ndim(values) == 3 and not (self.accumulate and k == 0):
                varying.append((self.inputs[k], np.asarray(values)))
            else:
                self.inputs[k][:] = values
        for at in range(0, count, CHUNK):
            size = min(CHUNK, count - at)
            for target, source in varying:
                target[:size] = source[at:at + size]
            self.call()
            for result, values in zip(found, self.results):
                result[at:at + size] = values[:size]
            if self.accumulate:
                self.inputs[0][0] = self.results[0][size - 1]
        return found

    def __call__(self, count: int, *arguments: FloatArray | float) -> FloatArray:
        """Return the first output; see `all`."""
        return self.all(count, *arguments)[0]


def without_fixed(function: ca.Function) -> tuple[ca.Function, ca.Function | None]:
    """Return a function whose last input is all that depends on its parameters alone, and that as their function."""
    inputs = function.sx_in()
    varying, symbols, fixed = ca.extract_parametric(function.call(inputs), inputs[-1], {"extract_trivial": True})
    if not symbols:
        return function, None
    made = ca.Function("fixed", [inputs[-1]], [ca.vertcat(*fixed)])
    return ca.Function(function.name(), [*inputs[:-1], ca.vertcat(*symbols)], varying, {"cse": True}), made
