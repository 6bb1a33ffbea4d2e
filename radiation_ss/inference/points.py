"""Known values of K at chosen frequencies as observations of the parameters (25)-(27)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.inference.parameters import Parametrisation

Points = Mapping[float, object] | Sequence[float]


@dataclass(frozen=True, eq=False)
class PointLikelihood:
    """K(i w_c) P(i w_c) - Q(i w_c) = 0 for each entry, real and imaginary part, with a small relative noise (27)."""

    parametrisation: Parametrisation
    omega: FloatArray  # (m,): Frequencies [rad/s]
    K: ComplexArray  # (m, n, n): Known values
    # Standard deviation relative to |K|; of an entry that is small beside its diagonal, relative to a hundredth of
    # sqrt(|K_jj K_kk|)
    tolerance: float
    size: int = 0

    def residual(self, u: FloatArray) -> FloatArray:
        """Return the standardised residuals; linear in u where the parametrisation is polynomial."""
        form = self.parametrisation
        theta = form.theta(u)
        K = form.K(theta, self.omega)
        diagonal = np.abs(np.einsum("wjj->wj", self.K))
        floor = 0.01 * np.sqrt(diagonal[:, :, None] * diagonal[:, None, :])
        scale = self.tolerance * np.maximum(np.abs(self.K), floor)
        rows = []
        for block in form.blocks:
            ratio = form.denominators(theta, self.omega, block) / form.denominators(form.mean, self.omega, block)
            rows += [(K[:, j, k] - self.K[:, j, k]) * ratio / scale[:, j, k] for j, k in block.entries]
        stacked = np.concatenate(rows)
        return np.concatenate([stacked.real, stacked.imag])

    def jacobian(self, u: FloatArray) -> FloatArray:
        """Return d residual / d u by central differences (exact where the residual is linear)."""
        step = 1e-4
        columns = [(self.residual(u + step * e) - self.residual(u - step * e)) / (2.0 * step) for e in np.eye(u.size)]
        return np.stack(columns, axis=1)

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood up to a constant."""
        return -0.5 * float(np.sum(self.residual(u) ** 2))

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient, Fisher information."""
        residual, jacobian = self.residual(u), self.jacobian(u)
        return -0.5 * float(residual @ residual), -jacobian.T @ residual, jacobian.T @ jacobian


def point_values(model: Model, points: Points) -> tuple[FloatArray, ComplexArray]:
    """Return (omega, K) of the points, shapes (m,) and (m, n, n), ascending.

    `points`: frequencies [rad/s] with K(iw) = B + i w (A - A_inf) known there; of bare frequencies K is read from the
    model's hydrodynamic data (interpolated), else from its fit. InputError if a frequency is not positive or outside
    the data, or a value has the wrong shape.
    """
    try:
        omega = np.array(sorted(float(w) for w in points))
    except (TypeError, ValueError):
        raise InputError(f"points: positive frequencies [rad/s] needed, found {list(points)}") from None
    if omega.size == 0 or not (omega > 0.0).all():
        raise InputError(f"points: positive frequencies [rad/s] needed, found {omega.tolist()}")
    if isinstance(points, Mapping):
        shape = (model.n, model.n)
        return omega, np.stack([np.broadcast_to(np.asarray(points[w], dtype=complex), shape) for w in sorted(points)])
    if model.hydro is None or model.hydro.A_inf is None:
        return omega, model.fit.frequency_response(omega)
    table = model.hydro
    if omega[0] < table.omega[0] or omega[-1] > table.omega[-1]:
        raise InputError(f"points: {omega.tolist()} rad/s reach outside the data, which cover {table.omega[0]:g} to "
                         f"{table.omega[-1]:g} rad/s")
    return omega, interpolate(table.omega, table.K, omega)


def known_points(model: Model, points: Points, parametrisation: Parametrisation,
                 tolerance: float) -> PointLikelihood:
    """Return the observations of K at the points; arguments and errors as `point_values`."""
    return PointLikelihood(parametrisation, *point_values(model, points), tolerance)


def interpolate(at: FloatArray, values: ComplexArray, omega: FloatArray) -> ComplexArray:
    """Return values (nw, ...) interpolated in frequency by a shape-keeping cubic."""
    from scipy.interpolate import PchipInterpolator

    if at.size < 2:
        return np.broadcast_to(values[:1], (omega.size, *values.shape[1:])).copy()
    real, imag = (PchipInterpolator(at, part, axis=0)(omega) for part in (values.real, values.imag))
    return np.asarray(real + 1j * imag)
