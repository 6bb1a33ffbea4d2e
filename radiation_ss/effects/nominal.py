"""The model's own numbers, free within their tolerance: the same kind of thing as an effect, with relative values.

And the effect of a radiation beyond it: a force larger or smaller by a share, and a memory of another length.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from radiation_ss.body.model import TOLERANCES as NAMES
from radiation_ss.body.model import Model, checked_tolerance
from radiation_ss.effects.definition import Active, Effect, Parameter
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import frequency_response

TOLERANCES = dict.fromkeys(NAMES, 0.02)
SHAPES = 6


class OwnNumber(NamedTuple):
    """A number of the model that may be off: its relative deviation as an effect, and the standard deviation of it."""

    active: Active
    spread: float


def tolerances(tolerance: float | Mapping[str, float] | None, stated: Mapping[str, float] | None = None,
               ) -> dict[str, float]:
    """Return the tolerance of each nominal quantity, from one number for all or by name.

    Where it names none: that which the model has `stated`, else 2 %. InputError if a name is unknown or a tolerance is
    not positive and below 1.
    """
    return {**TOLERANCES, **(stated or {}), **checked_tolerance({} if tolerance is None else tolerance)}


def nominal_effects(model: Model, tolerance: Mapping[str, float], *, force: bool) -> list[OwnNumber]:
    """Return the deviations of the model's numbers; with a `force` that acts, of its size and phase, too.

    Inertia is one number for each degree of freedom: mass and A_inf cannot be told apart by any motion.
    """
    found = []
    total = model.M + model.A_inf
    for i, dof in enumerate(model.dofs):
        spread = inertia_spread(model, tolerance, i, i) / total[i, i]
        found.append(OwnNumber(relative("inertia", dof, total[i, i], "a"), spread))
        if model.C[i, i] != 0.0:
            found.append(OwnNumber(relative("stiffness", dof, model.C[i, i], "x"), tolerance["stiffness"]))
        found += [OwnNumber(active, tolerance["kernel"]) for active in kernel_effects(model, i)]
        if force:
            gain = share_of("force", dof, input=lambda s, p: (1.0 + p.share) * s.u)
            found += [OwnNumber(active, tolerance["force"])
                      for active in (gain, force_phase(dof, natural_frequency(model, i)))]
    for i in range(model.n):
        for j in range(i):
            size = inertia_spread(model, tolerance, i, j)
            if size > 0.0:
                active = coupling(model.dofs[i], model.dofs[j], size / tolerance["A_inf"])
                found.append(OwnNumber(active, tolerance["A_inf"]))
    return found


def simulated_numbers(model: Model, tolerance: Mapping[str, float], *, force: bool) -> list[OwnNumber]:
    """Return those of a simulation's numbers: what the radiation's fit leaves out is tolerance of the kernel."""
    wide = float(np.hypot(tolerance["kernel"], np.nan_to_num(model.fit.relative_error)))
    return nominal_effects(model, {**tolerance, "kernel": wide}, force=force)


def inertia_spread(model: Model, tolerance: Mapping[str, float], i: int, j: int, zero: float = 1e-4) -> float:
    """Return the standard deviation of M + A_inf.

    A solver's error of a coupling A_inf goes with the two motions' own, however small the coupling is; what is no more
    than the share `zero` of them is zero by symmetry.
    """
    own = float(np.sqrt(model.A_inf[i, i] * model.A_inf[j, j]))
    added = own if abs(model.A_inf[i, j]) > zero * own else 0.0
    return float(np.hypot(tolerance["mass"] * model.M[i, j], tolerance["A_inf"] * added))


def couplings_by_symmetry(model: Model) -> list[Active]:
    """Return coupling inertia and damping, of the two motions' own, of each two that have none by symmetry."""
    total, none = model.M + model.A_inf, {"mass": 1.0, "A_inf": 1.0}
    pairs = [(i, j) for i in range(model.n) for j in range(i) if inertia_spread(model, none, i, j) == 0.0]
    return [coupling(model.dofs[i], model.dofs[j], float(np.sqrt(total[i, i] * total[j, j])) * factor, signal)
            for i, j in pairs for signal, factor in (("a", 1.0), ("v", natural_frequency(model, i)))]


def natural_frequency(model: Model, i: int) -> float:
    """Return sqrt(C / (M + A_inf)) [rad/s]; where nothing restores, the fastest of the others, or 1."""
    ratios = np.diag(model.C) / np.diag(model.M + model.A_inf)
    value = ratios[i] if ratios[i] > 0.0 else ratios.max()
    return float(np.sqrt(value)) if value > 0.0 else 1.0


def relative(name: str, dof: str, size: float, signal: str) -> Active:
    """A relative change of a diagonal coefficient: force -share size signal."""
    return share_of(name, dof, force=lambda s, p: -p.share * size * getattr(s, signal))


def share_of(name: str, dof: str, other: str = "", **law: Any) -> Active:
    """A number of the model with its `share` as the only parameter."""
    return Active(Effect(f"nominal_{name}", {"share": Parameter("1")}, family="nominal", **law), dof, other=other)


def coupling(dof: str, other: str, size: float, signal: str = "a") -> Active:
    """A change of the inertia between two degrees of freedom, or of what goes with their velocities, "v"."""
    def force(s: Any, p: Any) -> Any:
        return -p.share * size * getattr(s.other, signal), -p.share * size * getattr(s, signal)
    return share_of("coupling_inertia", dof, other, force=force, scope="pair")


def force_phase(dof: str, omega: float) -> Active:
    """A change of the exciting force's phase, in radians at `omega`."""
    return share_of("force_phase", dof, clock_in=lambda s, p: s.t - p.share / omega)


def kernel_effects(model: Model, i: int, octaves: float = 1.0) -> list[Active]:
    """The memory's deviations for one degree of freedom: its size, and its shape in the directions that matter.

    The force is -delta_c x_r with x_r the radiation states. The relative error of K(iw) is smooth: a complex Gaussian
    process over log w with standard deviation `share` and correlation exp(-d^2 / 2), d in units of `octaves`, from a
    third of the natural frequency to three times that or the end of the data. What the states can follow of it gives
    the directions of delta_c: the principal ones of the mean square relative error.
    """
    fit, omega_n = model.fit, natural_frequency(model, i)
    top = max(3.0 * omega_n, model.hydro.omega[-1] if model.hydro is not None else 0.0)
    omega = np.geomspace(0.3 * omega_n, top, 80)
    states = frequency_response(fit.a, fit.b[:, [i]], np.eye(fit.states), omega)[:, :, 0]
    K = states @ fit.c[i]
    if not np.any(K):
        return []
    relative, apart = states / K[:, None], np.subtract.outer(np.log2(omega), np.log2(omega)) / octaves
    both = np.concatenate([relative.real, relative.imag])
    process = np.kron(np.eye(2), np.exp(-0.5 * apart**2))
    follow = np.linalg.pinv(both, rcond=1e-4)
    covariance = follow @ process @ follow.T  # of delta_c for a share of 1
    left, sizes, _ = np.linalg.svd(both @ covariance @ both.T / omega.size)
    left = left * np.sign(left[np.abs(left).argmax(axis=0), np.arange(left.shape[1])])  # the sign of each is free
    rows = (follow @ left[:, :SHAPES] * np.sqrt(sizes[:SHAPES] * omega.size)).T
    return [memory_row("kernel", model.dofs[i], fit.c[i])] + [
        memory_row(f"kernel_shape_{k + 1}", model.dofs[i], row) for k, row in enumerate(rows)
        if sizes[k] > 0.01 * sizes[0]]


def memory_row(name: str, dof: str, row: np.ndarray) -> Active:
    """A change of one row of the memory's output matrix."""
    return share_of(name, dof, force=lambda s, p: -p.share * ca.dot(ca.DM(row), s.radiation))


def effects() -> list[Effect]:
    """Return the effect of a wrong radiation; without a model it is its share alone."""
    return [Effect("radiation_damping",
                   {"share": Parameter("1", 0, lambda s: 0.2, lower=-1.0),
                    "slower": Parameter("1", 0, lambda s: 1.0),
                    "longer": Parameter("1", 0, starts=lambda s: (0.0, 0.3, 0.8, -0.3), fixed=True)},
                   lambda s, p: -p.share * s.memory, linear=True, common=True, bind=with_memory,
                   rare=lambda values: values.get("longer", 0.0) != 0.0,
                   summary="the radiation force is larger or smaller than computed, by one share of one motion or of "
                           "all, and its memory fades more slowly: K + share K + slower (K(t / (1 + longer)) - K)")]


def with_memory(effect: Effect, model: Model, values: Mapping[str, float]) -> Effect:
    """Return the effect with own states: those of the model's radiation at another pace, driven by the same motion.

    Their force is K(t / (1 + longer)) by the velocities: as large at first as K, for a time 1 + longer times as long.
    A memory of the model's own length needs none.
    """
    fit, pace = model.fit, 1.0 + values.get("longer", 0.0)
    if fit.states == 0 or pace == 1.0:
        return effect
    if not pace > 0.0:
        raise InputError(f"effect {effect.name}: longer {pace - 1.0:g} found, more than -1 needed; the memory lasts "
                         "1 + longer times as long")

    def rates(s: Any, p: Any) -> list[Any]:
        own, velocity = ca.vertcat(*s.z), ca.vertcat(*(each.v for each in s.all))
        return ca.vertsplit(ca.mtimes(ca.DM(fit.a / pace), own) + ca.mtimes(ca.DM(fit.b), velocity))

    def force(s: Any, p: Any) -> Any:
        row = ca.DM(fit.c[model.dofs.index(s.dof)])
        return -p.share * s.memory - p.slower * (ca.dot(row, ca.vertcat(*s.z)) - s.memory)

    return replace(effect, force=force, rates=rates, states=fit.states)
