"""CasADi expressions as lists of instructions that run over many samples at a time."""

from collections.abc import Iterator, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError

# Positions are the codes that `integrator` knows.
OPERATIONS: dict[str, Any] = {
    "OP_INPUT": np.positive, "OP_OUTPUT": np.positive, "OP_ADD": np.add, "OP_SUB": np.subtract, "OP_MUL": np.multiply,
    "OP_DIV": np.divide, "OP_NEG": np.negative, "OP_SQ": np.square, "OP_TWICE": np.multiply, "OP_INV": np.reciprocal,
    "OP_IF_ELSE_ZERO": np.copyto, "OP_SIN": np.sin, "OP_COS": np.cos, "OP_TANH": np.tanh, "OP_EXP": np.exp,
    "OP_SQRT": np.sqrt, "OP_FABS": np.abs, "OP_SIGN": np.sign, "OP_LT": np.less, "OP_LE": np.less_equal,
    "OP_EQ": np.equal, "OP_NE": np.not_equal, "OP_NOT": np.logical_not, "OP_AND": np.logical_and,
    "OP_OR": np.logical_or, "OP_FMIN": np.minimum, "OP_FMAX": np.maximum, "OP_POW": np.power, "OP_CONSTPOW": np.power,
    "OP_LOG": np.log, "OP_TAN": np.tan, "OP_ASIN": np.arcsin, "OP_ACOS": np.arccos, "OP_ATAN": np.arctan,
    "OP_ATAN2": np.arctan2, "OP_SINH": np.sinh, "OP_COSH": np.cosh, "OP_ASINH": np.arcsinh, "OP_ACOSH": np.arccosh,
    "OP_ATANH": np.arctanh, "OP_FLOOR": np.floor, "OP_CEIL": np.ceil, "OP_FMOD": np.fmod, "OP_COPYSIGN": np.copysign,
    "OP_ERF": erf, "OP_LOG1P": np.log1p, "OP_EXPM1": np.expm1, "OP_HYPOT": np.hypot, "OP_ASSIGN": np.positive,
    "OP_LIFT": np.positive}
CODES = {getattr(ca, name): code for code, name in enumerate(OPERATIONS)}
LOAD, STORE, TWICE, IF_ELSE_ZERO = (CODES[getattr(ca, f"OP_{name}")] for name in ("INPUT", "OUTPUT", "TWICE",
                                                                                "IF_ELSE_ZERO"))
LOGICAL = range(CODES[ca.OP_LT], CODES[ca.OP_OR] + 1)  # true is 1.0
BLOCK = 1024  # samples side by side: their working memory stays in the cache


class Compiled:
    """A CasADi function of samples and, as its last input, parameters, with arrays [sample, column, row] in and out.

    `each` holds (code, target, two operands) of the instructions that are new for every sample, `once` those that
    parameters alone decide, `shapes` columns and rows of each output: in C order CasADi's own memory. Every instruction
    has its own place, so what parameters decide stays there.
    """

    ufuncs = tuple(OPERATIONS.values())

    def __init__(self, function: ca.Function) -> None:
        inputs = function.sx_in()
        made = ca.Function(function.name(), inputs, function.call(inputs), {"cse": True, "live_variables": False})
        self.shapes = [(made.size2_out(k), made.size1_out(k)) for k in range(made.n_out())]
        begin = np.cumsum([0] + [made.numel_in(k) for k in range(made.n_in() - 1)])
        end = np.cumsum([0] + [columns * rows for columns, rows in self.shapes])
        self.width, self.outputs = int(begin[-1]), int(end[-1])
        self.initial = np.zeros(made.sz_w())
        varies = [False] * made.sz_w()
        once: list[tuple[int, ...]] = []
        each: list[tuple[int, ...]] = []
        fixed, parameters = [], []
        for k in range(made.n_instructions()):
            operation, out, used = made.instruction_id(k), made.instruction_output(k), made.instruction_input(k)
            if operation == ca.OP_CONST:
                self.initial[out[0]] = made.instruction_constant(k)
            elif operation == ca.OP_INPUT and used[0] == made.n_in() - 1:
                parameters.append((out[0], used[1]))
            elif operation == ca.OP_INPUT:
                varies[out[0]] = True
                each.append((LOAD, out[0], begin[used[0]] + used[1], 0))
            elif operation == ca.OP_OUTPUT:
                place = end[out[0]] + out[1]
                if varies[used[0]]:
                    each.append((STORE, place, used[0], 0))
                else:
                    fixed.append((place, used[0]))
            elif operation not in CODES:
                raise InputError(f"{made.name()}: an effect's expression holds an operation that is not supported, "
                                 f"number {operation} of casadi.OP_*; use arithmetic and elementary functions")
            else:
                varies[out[0]] = any(varies[place] for place in used)
                (each if varies[out[0]] else once).append((CODES[operation], out[0], used[0], used[-1]))
        self.once, self.each, self.steps = table(once, 4), table(each, 4), each
        self.fixed, self.parameters = table(fixed, 2), table(parameters, 2)

    def prepared(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the working memory, and all outputs side by side as far as parameters alone decide them."""
        from radiation_ss.simulation.integrator import evaluate

        work, result = self.initial.copy(), np.zeros(self.outputs)
        work[self.parameters[:, 0]] = np.asarray(p)[self.parameters[:, 1]]
        if len(self.once):
            evaluate(self.once, work, result, result)
        result[self.fixed[:, 0]] = work[self.fixed[:, 1]]
        return work, result

    def all(self, count: int, *arguments: FloatArray | float) -> list[FloatArray]:
        """Return every output of `count` samples, shapes (count, columns, rows). An argument of three axes has a sample
        on the first, any other is the same for all samples; the last one are the parameters.
        """
        x, at = np.empty((count, self.width)), 0
        for a in arguments[:-1]:
            part = np.reshape(a, (count, -1)) if np.ndim(a) == 3 else np.ravel(a)
            x[:, at:at + part.shape[-1]] = part
            at += part.shape[-1]
        p, found = np.asarray(arguments[-1]), np.empty((count, self.outputs))
        for some in (slice(begin, begin + BLOCK) for begin in range(0, count, BLOCK)):
            found[some] = self.along([*np.ascontiguousarray(x[some].T)], p).T
        parts = np.split(found, np.cumsum([columns * rows for columns, rows in self.shapes])[:-1], axis=1)
        return [part.reshape(count, *shape) for part, shape in zip(parts, self.shapes)]

    def stepped(self, places: list[Any], rows: Any, xp: Any) -> Iterator[tuple[int, Any]]:
        """Run the instructions that are new for every sample on rows of any array library; give place and output."""
        operations = self.ufuncs if xp is np else tuple(getattr(xp, f.__name__, xp.positive) for f in self.ufuncs)
        for code, out, one, two in self.steps:
            if code == LOAD:
                places[out] = rows[one]
            elif code == STORE:
                yield out, places[one]
            elif code == TWICE:
                places[out] = 2.0 * places[one]
            elif code == IF_ELSE_ZERO:
                places[out] = xp.where(places[one] != 0.0, places[two], 0.0)
            else:
                binary = self.ufuncs[code].nin == 2
                value = operations[code](places[one], places[two]) if binary else operations[code](places[one])
                places[out] = 1.0 * value if code in LOGICAL else value

    def along(self, rows: Sequence[FloatArray], p: FloatArray) -> FloatArray:
        """Return all outputs side by side, shape (outputs, samples), for a row of samples of each input."""
        work, decided = self.prepared(p)
        found = np.repeat(decided[:, None], rows[0].size, axis=1)
        with np.errstate(all="ignore"):
            for place, value in self.stepped(list(work), rows, np):
                found[place] = value
        return found

    def steps_along(self, rows: Sequence[FloatArray], p: FloatArray, states: int) -> FloatArray:
        """Return the states (states, samples + 1) of a recursion from zero; they are the first inputs, `rows` the
        others.
        """
        from radiation_ss.simulation.integrator import recur

        work, result = self.prepared(p)
        each, read = self.each.copy(), (self.each[:, 0] == LOAD) & (self.each[:, 2] >= states)
        used, place = np.unique(self.each[read, 2], return_inverse=True)
        each[read, 2] = states + place
        signals = np.empty((rows[0].size, used.size))
        for column, k in enumerate(used):
            signals[:, column] = rows[k - states]
        return recur(each, work, signals, result[:states]).T

    def __call__(self, count: int, *arguments: FloatArray | float) -> FloatArray:
        """Return the first output; see `all`."""
        return self.all(count, *arguments)[0]


def table(rows: Sequence[tuple[int, ...]], columns: int) -> NDArray[np.int64]:
    """Return rows of numbers as an array, also if there are none."""
    return np.array(rows, dtype=np.int64).reshape(-1, columns)


def run_instructions(compiled: Compiled, rows: Any, xp: Any) -> list[Any]:
    """Return every output, one row each, of a function whose parameters are samples, too; of any array library."""
    work, decided = compiled.prepared(np.zeros(0))
    found = dict(enumerate(decided.tolist())) | dict(compiled.stepped(list(work), rows, xp))
    return list(found.values())
