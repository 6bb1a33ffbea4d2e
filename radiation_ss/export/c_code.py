"""C source of the corrected plant and of the live filter, by CasADi: no libraries, no heap."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.convert import opened
from radiation_ss.body.model import Model
from radiation_ss.effects import activated
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.default import DefaultEngine
from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.filter.marginal import step_matrices
from radiation_ss.filter.plan import rows_of
from radiation_ss.inference.kalman import Gaussian, predict, update
from radiation_ss.methods import accepting
from radiation_ss.simulation.native import signals_of, state_equations


@accepting(plant=opened)
def write_c(plant: Model | DualEnKF, path: str | Path, effects: Iterable[Any] = (), *, dt: float | None = None) -> Path:
    """Write a plant, or a filter, as C source with a header beside it; the file's head says how to call it.

    Of a Model: `plant_rate` (t, x, u) -> (x', y), and with `dt` `plant_step` (t, x, u) -> (x after dt, y), one step of
    the classical Runge-Kutta method under constant u. Of a DualEnKF after `prepare` or `run`: `filter_step` (x, y) ->
    (x, force, its standard deviation), the Kalman filter at the parameters reached so far, with the gain that it
    settles to and the record's interval. A sample that is NaN, or beyond the filter's gate, counts as missing; the gain
    stays.

    Parameters
    ----------
    plant : Model, path or DualEnKF
    path : str or Path
        Ends in .c.
    effects : iterable
        With a Model, as in `simulate`; `diagnosis.corrected` for a diagnosed body. Delays are left out.
    dt : float, optional
        Time step of `plant_step` [s].

    Raises
    ------
    InputError
        If the name does not end in .c, or the filter is not prepared or not the default one.
    SolverError
        If the filter's gain does not settle.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0)
    >>> rss.write_c(model, "heave.c", [("quadratic_drag", {"coefficient": 3.0})], dt=0.01).name
    'heave.c'
    """
    target = Path(path)
    if target.suffix != ".c" or not target.stem.isidentifier() or not target.parent.is_dir():
        raise InputError(f"{path}: a name of letters, digits and _ that ends in .c, in a folder that exists, is needed")
    if isinstance(plant, DualEnKF):
        functions, lists = _filter(plant)
    else:
        functions, lists = _plant(plant, activated(effects, plant), dt)
    generator = ca.CodeGenerator(target.stem, {"with_header": True})
    for function in functions:
        generator.add(function)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        generator.generate()
        source, header = (Path(target.name).with_suffix(s).read_text(encoding="utf-8") for s in (".c", ".h"))
    target.write_text(_head(functions, lists) + source, encoding="utf-8")
    target.with_suffix(".h").write_text(header, encoding="utf-8")
    return target


def _plant(model: Model, effects: tuple[Any, ...], dt: float | None) -> tuple[list[ca.Function], dict[str, list[str]]]:
    """Return the functions of the plant, and the names of their signals."""
    names, rate = ["t", "x", "u"], state_equations(model, effects)
    functions = [ca.Function("plant_rate", *_symbols(rate), names, ["rate", "y"])]
    if dt is not None:
        (t, x, u), out = _symbols(rate)
        k1, y = out
        k2 = rate(t + dt / 2, x + dt / 2 * k1, u)[0]
        k3 = rate(t + dt / 2, x + dt / 2 * k2, u)[0]
        k4 = rate(t + dt, x + dt * k3, u)[0]
        after = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        functions.append(ca.Function("plant_step", [t, x, u], [after, y], names, ["after", "y"]))
    states, inputs, outputs = signals_of(model, effects)
    return functions, {"x": states, "u": inputs, "y": outputs}


def _symbols(rate: ca.Function) -> tuple[list[Any], list[Any]]:
    arguments = [ca.MX.sym(f"i{k}", rate.sparsity_in(k)) for k in range(rate.n_in())]
    return arguments, list(rate(*arguments))


def _filter(filter_: DualEnKF) -> tuple[list[ca.Function], dict[str, list[str]]]:
    """Return the filter's step, and the names of its channels."""
    engine = filter_.engine
    if not isinstance(engine, DefaultEngine):
        raise InputError("write_c: a default DualEnKF (preset=None) after prepare(record) or run(record) is needed")
    system = engine.system
    there = np.isfinite(filter_.sensor_noise.ravel())
    steps = int(np.ceil(filter_.interval / filter_.longest - 1e-9))
    F, Q = (np.zeros((system.H.shape[1], system.H.shape[1])) for _ in range(2))
    step_matrices(system, engine.state.theta, filter_.interval / steps, F, Q)
    whole, noise = np.eye(F.shape[0]), np.zeros_like(F)
    for _ in range(steps):
        whole, noise = F @ whole, F @ noise @ F.T + Q
    gain, spread, innovation = settled_gain(Gaussian(np.zeros(F.shape[0]), engine.state.P), whole, noise,
                                            system.H[there], np.diag(system.r[there]))
    x, y = ca.MX.sym("x", F.shape[0]), ca.MX.sym("y", int(there.sum()))
    ahead = ca.mtimes(ca.DM(whole), x)
    e = y - ca.mtimes(ca.DM(system.H[there]), ahead)
    e = ca.if_else(ca.fabs(e) < engine.rules.gate * np.sqrt(innovation), e, 0.0)
    after = ahead + ca.mtimes(ca.DM(gain), e)
    at = slice(F.shape[0] - 2 * filter_.model.n, F.shape[0], 2)
    step = ca.Function("filter_step", [x, y], [after, after[at], ca.DM(spread[at])], ["x", "y"],
                       ["after", "force", "std"])
    channels = list(rows_of(filter_.model.dofs))
    return [step], {"y": [name for name, have in zip(channels, there) if have], "force": list(filter_.model.dofs)}


def settled_gain(state: Gaussian, F: FloatArray, Q: FloatArray, H: FloatArray, R: FloatArray, tolerance: float = 1e-10,
                 limit: int = 20000) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the gain that a Kalman filter settles to, the standard deviation of its states and of its innovations.

    Settled is where a step changes no variance by more than `tolerance` of itself.
    """
    for _ in range(limit):
        ahead = predict(state, F, Q)
        last, (state, _, S) = state, update(ahead, H, np.zeros(H.shape[0]), R)
        if np.all(np.abs(np.diag(state.cov - last.cov)) <= tolerance * np.diag(state.cov)):
            return np.linalg.solve(S, H @ ahead.cov).T, *(np.sqrt(np.diagonal(P)) for P in (state.cov, S))  # type: ignore
    raise SolverError(f"write_c: the filter's gain does not settle in {limit} steps")


def _head(functions: list[ca.Function], lists: dict[str, list[str]]) -> str:
    """Return the comment that says how to call the functions."""
    lines = ["SI units. f(arg, res, iw, w, 0) returns 0: const double *arg[], double *res[], casadi_int iw[], double",
             "w[], of the sizes that f_work(&arg, &res, &iw, &w) gives. Input and output are different arrays."]
    for f in functions:
        into, out = (", ".join(f"{name}[{size}]" for name, size in zip(names, sizes)) for names, sizes in (
            (f.name_in(), [f.numel_in(k) for k in range(f.n_in())]),
            (f.name_out(), [f.numel_out(k) for k in range(f.n_out())])))
        lines.append(f"{f.name()}: {into} -> {out}")
    lines += [f"{name}: {', '.join(items)}" for name, items in lists.items()]
    return "/*\n" + "\n".join(f" * {line}" for line in lines) + "\n */\n"
