"""Plants that the filter takes: a Model, and a ct.StateSpace with the signals of `cummins`, continuous or sampled."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import logm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.convert import ModelLike, as_model
from radiation_ss.body.discretisation import hold_matrices
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError

if TYPE_CHECKING:
    import control as ct

Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def model_of(plant: ModelLike) -> Model:
    """Return a plant as a Model; a sampled ct.StateSpace is made continuous first."""
    if hasattr(plant, "input_labels") and plant.dt not in (0, None):
        return as_model(continuous(plant))
    return as_model(plant)


def continuous(system: ct.StateSpace, tolerance: float = 1e-6) -> ct.StateSpace:
    """Return the continuous system behind a sampled composite one, by whichever of zoh, foh and tustin made it.

    Only by the right one is the output `<dof>_vel` the rate of `<dof>`, to a relative `tolerance`. InputError if none
    of the three fits, or dt is not known.
    """
    import control as ct

    if isinstance(system.dt, bool):
        raise InputError(f"{system.name}: discrete without a time step; give dt [s]")
    outputs = list(system.output_labels)
    stems = [label.removesuffix("_force") for label in system.input_labels]
    absent = [s for stem in stems for s in (stem, f"{stem}_vel") if s not in outputs]
    if absent:
        raise InputError(f"{system.name}: output {absent[0]!r} is missing; it has {', '.join(outputs)}")
    x, v = ([outputs.index(stem + tail) for stem in stems] for tail in ("", "_vel"))
    found = [_undo(method, (system.A, system.B, system.C, system.D), float(system.dt))
             for method in ("zoh", "foh", "tustin")]

    def off(matrices: Matrices) -> float:
        F, G, H, J = matrices
        size = [np.abs(part).max() + 1e-300 for part in (H[v], H[v] @ G, np.abs(H[x]).max() * G)]
        parts = (H[x] @ F - H[v], J[v], H[x] @ G)
        return max(float(np.abs(part).max() / one) for part, one in zip(parts, size))

    best = min(found, key=off)
    if not off(best) < tolerance:
        raise InputError(f"{system.name}: sampled, but neither by zoh nor by foh nor by tustin at dt = {system.dt:g} s "
                         f"is {stems[0]}_vel the rate of {stems[0]}; give the continuous system")
    F, G, H, J = best
    return ct.ss(F, G, H, np.where(np.abs(J) > tolerance * np.abs(J).max(), J, 0.0), inputs=list(system.input_labels),
                 outputs=outputs, name=system.name)


def _undo(method: str, system: Matrices, dt: float) -> Matrices:
    """Return the continuous (A, B, C, D) of a sampled one; the inverse of `body.discretisation.discretise`."""
    A, B, C, D = system
    one = np.eye(len(A))
    if method == "tustin":
        a = np.asarray(2.0 / dt * np.linalg.solve((A + one).T, (A - one).T).T)
        left = one - 0.5 * dt * a
        b, c = left @ B / dt, C @ left
        return a, b, c, D - 0.5 * c @ B
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its accuracy is judged by what comes out
        a = np.asarray(np.real(logm(A)) / dt, dtype=np.float64)
    _, held, after = hold_matrices(a, one, dt)
    if method == "zoh":
        return a, np.asarray(np.linalg.solve(held, B)), C, D
    b = np.asarray(np.linalg.solve(held - after + A @ after, B))
    return a, b, C, D - C @ after @ b
