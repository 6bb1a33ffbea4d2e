"""A model with effects, or the live filter's step, as C source without a heap, written by CasADi.

The filter is the Kalman filter at the parameters reached so far. While every sample comes, its gain is the one that it
settles to. After one that is missing the covariance moves along until it has settled again: the settled gain would
make a leap of what the motion has gone by unseen.
"""

import contextlib
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import solve_discrete_are

from radiation_ss.arrays import FloatArray, positive
from radiation_ss.body.composite import system_matrices
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.bank import bank_of
from radiation_ss.filter.default import DefaultEngine
from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.filter.plan import rows_of
from radiation_ss.methods import accepting
from radiation_ss.simulation.native import signals_of, state_equations, without_delays

NEAR = 0.1  # between the parameters and those of the filters beside, in standard deviations
SETTLED = 1e-6  # of the settled covariance


@accepting(plant=lambda given: given if isinstance(given, DualEnKF) else as_model(given))
def write_c(plant: Model | DualEnKF, path: str | Path, effects: Iterable[Any] = (), *, dt: float | None = None) -> Path:
    """Write a plant, or a filter, as C source with a header beside it; the file's head says how to call it.

    Of a Model: `plant_rate` (t, x, u) -> (x', y), and with `dt` `plant_step` (t, x, u) -> (x after dt, y), by the
    classical Runge-Kutta method under constant u, in several steps where the fastest pole asks for them. Of a DualEnKF
    after `prepare` or `run`: `filter_step` (x, y) -> (x, force, its standard deviation), the Kalman filter at the
    parameters reached so far, at the record's interval, and beside it one for each direction in which the parameters
    are unsure: the standard deviation holds both. A sample that is NaN, or beyond the filter's gate, counts as missing:
    gain and standard deviation are then those of a filter without it, at the price of a step that takes longer, until
    they have settled again. x is zero before the first sample.

    Parameters
    ----------
    plant : Model, control.StateSpace, path or DualEnKF
    path : str or Path
        Ends in .c.
    effects : iterable
        With a Model, as in `simulate`; `diagnosis.corrected` for a diagnosed body; as in `write_fmu`.
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
        functions, lists = filter_source(plant)
        dt = plant.interval
    else:
        functions, lists = _plant(plant, without_delays(plant, effects), dt)
    generator = ca.CodeGenerator(target.stem, {"with_header": True})
    for function in functions:
        generator.add(function)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        generator.generate()
        source, header = (Path(target.name).with_suffix(s).read_text(encoding="utf-8") for s in (".c", ".h"))
    target.write_text(_head(functions, lists, dt) + source, encoding="utf-8")
    target.with_suffix(".h").write_text(header, encoding="utf-8")
    return target


def _plant(model: Model, effects: tuple[Any, ...], dt: float | None,
           turn: float = 1.0) -> tuple[list[ca.Function], dict[str, list[str]]]:
    """Return the plant's functions, and names of its signals; `turn` [rad]: of the fastest pole a step (most 2.7)."""
    names, rate = ["t", "x", "u"], state_equations(model, effects)
    functions = [ca.Function("plant_rate", *_symbols(rate), names, ["rate", "y"])]
    if dt is not None:
        dt = positive(dt, "dt", "s")
        (t, x, u), (_, y) = _symbols(rate)
        parts = max(1, int(np.ceil(dt * np.abs(np.linalg.eigvals(model.matrices()[0])).max() / turn)))
        z = ca.MX.sym("z", x.numel() + 1)  # the states, and time
        flow = ca.Function("flow", [z, u], [ca.vertcat(rate(z[-1], z[:-1], u)[0], 1)])
        after = ca.simpleRK(flow, parts)(ca.vertcat(x, t), u, dt)[:-1]
        functions.append(ca.Function("plant_step", [t, x, u], [after, y], names, ["after", "y"]))
    states, inputs, outputs = signals_of(model, effects)
    return functions, {"x": states, "u": inputs, "y": outputs}


def _symbols(rate: ca.Function) -> tuple[list[Any], list[Any]]:
    arguments = [ca.MX.sym(f"i{k}", rate.sparsity_in(k)) for k in range(rate.n_in())]
    return arguments, list(rate(*arguments))


def _head(functions: list[ca.Function], lists: dict[str, list[str]], dt: float | None) -> str:
    """Return the comment that says how to call the functions, `dt` [s] apart."""
    lines = ["SI units. f(arg, res, iw, w, 0) returns 0: const double *arg[], double *res[], casadi_int iw[], double",
             "w[], of the sizes that f_work(&arg, &res, &iw, &w) gives. Input and output are different arrays."]
    for f in functions:
        into, out = (", ".join(f"{name}[{size}]" for name, size in zip(names, sizes)) for names, sizes in (
            (f.name_in(), [f.numel_in(k) for k in range(f.n_in())]),
            (f.name_out(), [f.numel_out(k) for k in range(f.n_out())])))
        lines.append(f"{f.name()}: {into} -> {out}")
    lines += [f"{name}: {', '.join(items)}" for name, items in lists.items()]
    if dt is not None:
        held = ", u constant between" if "u" in lists else ""
        lines.append(f"one call of {functions[-1].name()} every {dt!r} s{held}")
    return "/*\n" + "\n".join(f" * {line}" for line in lines) + "\n */\n"


def filter_source(filter_: DualEnKF) -> tuple[list[ca.Function], dict[str, list[str]]]:
    """Return the filter's step, and the names of its channels.

    States are those of the filter, then those of the filters beside it, then how far the covariance is off the settled
    one: all zero they are a settled filter at rest.
    """
    engine = filter_.engine
    if not isinstance(engine, DefaultEngine):
        raise InputError("write_c: a default DualEnKF (preset=None) after prepare(record) or run(record) is needed")
    there = np.isfinite(filter_.sensor_noise.ravel())
    centre = engine.state.theta[:, -2]
    thetas = centre + NEAR * np.vstack([np.zeros(centre.size), deviations(filter_, engine.state.theta[:, :-2].T)])
    plants = [system_matrices(filter_.model.replace(fit=filter_.parts.fit(theta))) for theta in thetas]
    bank = bank_of(plants, filter_.force_model, filter_.sensor_noise, engine.state.P)
    (F, Q), H, r = bank.steps(filter_.interval), bank.H[:, there], bank.r[there]
    settled, (count, channels, size) = settled_covariance(F[0], Q, H[0], r), H.shape
    x, y = ca.MX.sym("x", size * (count + size)), ca.MX.sym("y", channels)
    z, off = ca.reshape(x[:size * count], size, count), ca.reshape(x[size * count:], size, size)
    ahead = ca.horzcat(*(ca.mtimes(ca.sparsify(ca.DM(own)), z[:, k]) for k, own in enumerate(F)))
    gate = engine.rules.gate
    usual, carried = settled_update(H, r, settled), carried_update(F[0], Q, H, r, settled, gate)
    S = H[0] @ (F[0] @ settled @ F[0].T + Q) @ H[0].T
    every = ca.mmin(taken(innovations(H, ahead, y), np.diag(S) + r, gate))
    still = ca.logic_and(every, ca.norm_inf(ca.vec(off)) == 0.0)
    after, off = ca.Function.if_else("update", usual, carried)(still, ahead, off, y)
    rows = slice(size - 2 * filter_.model.n, size, 2)
    force = after[rows, :]
    std = ca.sqrt(ca.fmax(np.diag(settled)[rows] + ca.diag(off)[rows], 0.0) + spread(force))
    step = ca.Function("filter_step", [x, y], [ca.vertcat(ca.vec(after), ca.vec(off)), force[:, 0], std], ["x", "y"],
                       ["after", "force", "std"])
    return [step], {"y": [name for name, have in zip(rows_of(filter_.model.dofs), there) if have],
                    "force": list(filter_.model.dofs), "a missing sample": ["NaN"]}


def settled_update(H: FloatArray, r: FloatArray, P: FloatArray) -> ca.Function:
    """Return (states ahead, covariance off the settled one, samples) -> the two after all samples, at the settled P."""
    z, off, y = ca.MX.sym("z", *H.shape[::-2]), ca.MX.sym("off", *P.shape), ca.MX.sym("y", r.size)
    gain = P @ H[0].T / r
    return ca.Function("settled", [z, off, y], [z + ca.mtimes(ca.DM(gain), innovations(H, z, y)), off])


def carried_update(F: FloatArray, Q: FloatArray, H: FloatArray, r: FloatArray, settled: FloatArray, gate: float,
                   ) -> ca.Function:
    """Return the same with a covariance of its own; of the samples, which are taken one by one, some may be missing."""
    z, off, y = ca.MX.sym("z", *H.shape[::-2]), ca.MX.sym("off", *settled.shape), ca.MX.sym("y", r.size)
    step, rows = ca.sparsify(ca.DM(F)), [ca.sparsify(ca.DM(row)) for row in H[0]]
    P = F @ settled @ F.T + Q + ca.mtimes(ca.mtimes(step, off), step.T)
    use = taken(innovations(H, z, y), ca.vertcat(*(ca.bilin(P, row, row) for row in rows)) + r, gate)
    after = z
    for c, (row, variance) in enumerate(zip(rows, r)):
        seen = ca.mtimes(P, row)
        gain = use[c] * seen / (ca.dot(row, seen) + variance)
        e = innovations(H[:, c:c + 1], after, y[c])
        after, P = after + ca.mtimes(gain, ca.if_else(use[c], e, 0.0)), P - ca.mtimes(gain, seen.T)
    left, size = 0.5 * (P + P.T) - settled, np.sqrt(np.maximum(np.diag(settled), 1e-300))
    far = ca.norm_inf(ca.vec(left / np.outer(size, size))) > SETTLED
    return ca.Function("carried", [z, off, y], [after, ca.if_else(far, left, 0.0)])


def innovations(H: FloatArray, z: ca.MX, y: ca.MX) -> ca.MX:
    """Return what samples differ from those of each filter, (channels, filters)."""
    return ca.vertcat(*(y[c] - ca.sum1(ca.sparsify(ca.DM(H[:, c].T)) * z) for c in range(H.shape[1])))


def spread(values: ca.MX) -> ca.MX:
    """Return the variance that the parameters' uncertainty gives a row of values, of the filter and those beside it."""
    return ca.sum2(((values[:, 1:] - ca.repmat(values[:, 0], 1, values.shape[1] - 1)) / NEAR) ** 2)


def taken(e: ca.MX, variance: ca.MX | ca.DM | FloatArray, gate: float) -> ca.MX:
    """Return which samples are within the gate; one that is NaN is not."""
    return ca.fabs(e[:, 0]) < gate * ca.sqrt(variance + spread(e))


def deviations(filter_: DualEnKF, members: FloatArray, least: float = 0.1) -> FloatArray:
    """Return the directions (k, n_theta) of the members (N, n_theta) along which K varies most, one deviation long.

    Each entry of K in units of the largest of its two motions; those below a share `least` of the first are left out.
    """
    fits = [filter_.parts.fit(theta) for theta in members]
    poles = np.abs(np.linalg.eigvals(fits[0].a))
    K = np.stack([fit.frequency_response(np.geomspace(0.3 * poles.min(), 3.0 * poles.max(), 24)) for fit in fits])
    size = np.sqrt(np.abs(np.einsum("mwii->mwi", K)).max(axis=(0, 1)))
    rows = ((K - K.mean(axis=0)) / np.outer(size, size)).reshape(len(fits), -1)
    u, share, _ = np.linalg.svd(np.hstack([rows.real, rows.imag]), full_matrices=False)
    return np.asarray(u[:, share > least * share[0]].T @ (members - members.mean(axis=0)) / np.sqrt(len(fits) - 1))


def settled_covariance(F: FloatArray, Q: FloatArray, H: FloatArray, r: FloatArray) -> FloatArray:
    """Return the covariance that a Kalman filter has after each sample in the end."""
    try:
        P = solve_discrete_are(F.T, H.T, Q, np.diag(r))
    except np.linalg.LinAlgError as error:
        raise SolverError(f"write_c: the filter's gain does not settle ({error})") from None
    S = H @ P @ H.T + np.diag(r)
    gain = np.linalg.solve(S, H @ P).T
    return np.asarray(P - gain @ S @ gain.T)
