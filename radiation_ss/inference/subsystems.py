"""The parameter vector theta: coefficients of the subsystem of every entry of the radiation matrix (5)-(7), (14)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.inference.parameters import ParameterBlock, Parametrisation

MAX_ORDER = 12


@dataclass(frozen=True, eq=False)
class Subsystems:
    """Rational subsystems of the entries of K, each with parameters [a1 .. an, b1 .. bn] (23).

    Entries jk and kj share their parameters (L24 = L42 in the paper) but have states of their own.
    """

    dofs: tuple[str, ...]
    entries: tuple[tuple[int, int], ...]  # Entries (j, k), j <= k, that have a subsystem
    orders: tuple[int, ...]  # Order of each
    theta: FloatArray  # (n_theta,): Start values

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.dofs)

    @property
    def offsets(self) -> tuple[int, ...]:
        """Where the parameters of each entry start in theta."""
        return tuple(int(v) for v in np.cumsum([0, *(2 * order for order in self.orders)])[:-1])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters: `Heave.a1`, `Sway-Roll.b5`."""
        stems = [self.dofs[j] if j == k else f"{self.dofs[j]}-{self.dofs[k]}" for j, k in self.entries]
        return tuple(f"{stem}.{letter}{i + 1}" for stem, order in zip(stems, self.orders)
                     for letter in "ab" for i in range(order))

    @property
    def pairs(self) -> np.ndarray:
        """Directed pairs, shape (n_pairs, 5): force dof j, velocity dof k, offset in theta, offset in state, order."""
        rows, state = [], 0
        for (j, k), offset, order in zip(self.entries, self.offsets, self.orders):
            for force, velocity in ((j, k),) if j == k else ((j, k), (k, j)):
                rows.append((force, velocity, offset, state, order))
                state += order
        return np.array(rows, dtype=np.int64).reshape(-1, 5)

    @cached_property
    def form(self) -> Parametrisation:
        """The map between theta and K, each entry with poles of its own; deviations are the values themselves."""
        blocks = tuple(ParameterBlock((entry,), order, "polynomial", 0, start, (0,))
                       for entry, order, start in zip(self.entries, self.orders, self.offsets))
        A_inf = np.zeros((self.n, self.n))
        return Parametrisation(self.dofs, A_inf, blocks, self.theta, np.abs(self.theta), self.names)

    @property
    def states(self) -> int:
        """Number of radiation states."""
        return int(self.pairs[:, 4].sum())

    def K(self, theta: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Return K(iw) for parameter vectors of shape (..., n_theta): shape (..., nw, n, n) (23)."""
        return self.form.K(np.asarray(theta, dtype=float), omega)

    def poles(self, theta: ArrayLike) -> list[ComplexArray]:
        """Return the poles of each entry for parameter vectors of shape (..., n_theta), each shape (..., order)."""
        values, poles = np.asarray(theta, dtype=float), []
        for offset, order in zip(self.offsets, self.orders):
            companion = np.zeros((*values.shape[:-1], order, order))
            companion[..., range(1, order), range(order - 1)] = 1.0
            companion[..., :, -1] = -values[..., offset:offset + order]
            poles.append(np.linalg.eigvals(companion).astype(complex))
        return poles

    def stable(self, theta: ArrayLike) -> np.ndarray:
        """Return whether every pole lies in the left half plane, shape (...)."""
        return self.form.stable(np.asarray(theta, dtype=float))

    def damping(self, theta: ArrayLike, omega: ArrayLike, scale: FloatArray | None = None) -> FloatArray:
        """Return the least eigenvalue of Re K(iw) at the given frequencies, shape (..., nw).

        With `scale` (n, n), of Re K / scale: degrees of freedom of different units are then comparable.
        """
        real = self.K(theta, omega).real / (1.0 if scale is None else scale)
        if self.n == 1:
            return np.asarray(real[..., 0, 0])
        return np.asarray(np.linalg.eigvalsh(0.5 * (real + real.swapaxes(-1, -2)))[..., 0])

    def fit(self, theta: ArrayLike, A_inf: FloatArray | None = None) -> RadiationFit:
        """Return the block-diagonal realisation in the paper's observer form (5)-(7), (12)."""
        values, m = np.asarray(theta, dtype=float), self.states
        a, b, c = np.zeros((m, m)), np.zeros((m, self.n)), np.zeros((self.n, m))
        for force, velocity, offset, at, order in self.pairs:
            rows = np.arange(at, at + order)
            a[rows[1:], rows[:-1]] = 1.0
            a[rows, rows[-1]] -= values[offset:offset + order]
            b[rows, velocity] = values[offset + order:offset + 2 * order]
            c[force, rows[-1]] = 1.0
        return RadiationFit(dofs=self.dofs, a=a, b=b, c=c, order=max(self.orders), A_inf=A_inf, method="dual-enkf")


def subsystems_of(fit: RadiationFit, entries: Sequence[tuple[str, str]] | None = None) -> Subsystems:
    """Write a fit entry by entry as rational functions, the form whose parameters the filter estimates.

    `entries`: pairs of degrees of freedom to keep; all that are not zero by default. InputError if an entry needs more
    than 12 states: fit it entry by entry, or with a lower order.
    """
    wanted = None if entries is None else {tuple(sorted((fit.dofs.index(j), fit.dofs.index(k)))) for j, k in entries}
    scale = _gain(fit)
    kept, orders, theta = [], [], []
    for j in range(len(fit.dofs)):
        for k in range(j, len(fit.dofs)):
            small = scale[j, k] <= 1e-6 * np.sqrt(scale[j, j] * scale[k, k])
            if small or (wanted is not None and (j, k) not in wanted):
                continue
            den, num = fit.polynomials(j, k)
            if den.size > MAX_ORDER:
                raise InputError(f"fit: entry {fit.dofs[j]}-{fit.dofs[k]} has order {den.size}, the filter takes up to "
                                 f"{MAX_ORDER}; fit entry by entry or with a lower order")
            # A coefficient that is next to nothing at the poles' frequency is zero, and stays so: K(0) = 0.
            size = np.abs(num) * np.abs(den[0]) ** (np.arange(den.size) / den.size)
            num = np.where(size > 1e-8 * size.max(), num, 0.0)
            kept.append((j, k))
            orders.append(den.size)
            theta += [*den, *num]
    if not kept:
        raise InputError("fit: no radiation entry to estimate")
    return Subsystems(fit.dofs, tuple(kept), tuple(orders), np.array(theta))


def _gain(fit: RadiationFit) -> FloatArray:
    """Return the largest |K_jk(iw)| over the frequencies of the poles, shape (n, n)."""
    omega = np.unique(np.abs(np.linalg.eigvals(fit.a)))
    if not np.any(omega > 0.0):
        raise InputError(f"fit: no radiation model of {', '.join(fit.dofs)} (it has no states); give the plant one, "
                         "as by radiation= of rss.body")
    return np.abs(fit.frequency_response(omega[omega > 0.0])).max(axis=0)
