"""Parameters of the radiation subsystem: coefficients (5)-(8) of its entries, with a prior around the model's."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.fit.result import RadiationFit
from radiation_ss.inference.remainder import Remainder


@dataclass(frozen=True, eq=False)
class ParameterBlock:
    """Entries (j, k), j <= k, with one denominator.

    form "polynomial": a_1 ... a_r and b_1 ... b_r of (23), ascending powers.
    places: which numerator of theta belongs to each entry, counted from the denominator's end.
    form "sections": partial fractions (r1 s + r0)/(s^2 + c1 s + c0), `quadratic` of them, then r/(s + c).
    zero: K(0) = 0 is kept: each entry's first numerator (b_1, r0 or r) follows from the others.
    rest: what the model's order leaves out; a small term about zero, no part of the subsystem that is handed on.
    """

    entries: tuple[tuple[int, int], ...]
    order: int
    form: str
    quadratic: int
    start: int
    places: tuple[int, ...]
    zero: bool = False
    rest: bool = False

    @property
    def denominator(self) -> slice:
        """Where the denominator's parameters stand in theta."""
        return slice(self.start, self.start + self.order)

    def numerator(self, entry: int) -> slice:
        """Where the numerator's parameters of the block's entry number `entry` stand in theta."""
        start = self.start + self.order * (1 + self.places[entry])
        return slice(start, start + self.order)


@dataclass(frozen=True, eq=False)
class Parametrisation:
    """Map between theta and K(s), with the prior: mean = the model's own values, normal deviations."""

    dofs: tuple[str, ...]
    A_inf: FloatArray  # (n, n): Taken as known
    blocks: tuple[ParameterBlock, ...]
    # mean, std (d,): Prior of theta; std 0 fixes a parameter (a coefficient that is exactly zero)
    mean: FloatArray
    std: FloatArray
    names: tuple[str, ...]
    # Numbers of the model that are free too: what ("inertia", "stiffness", "sensor", "force"),
    # of which degree of freedom (-1: none of these), its tolerance, and where it stands in u. The number is 1 +
    # tolerance sinh(tail u) / tail times its nominal value: heavier tails than a normal distribution, because a stated
    # tolerance is itself a guess.
    nominal: tuple[tuple[str, int, float, int], ...] = ()
    tail: float = 0.5
    # (d_theta, d_theta): Root of the prior covariance of the parameters of theta that may move; independent without it
    root: FloatArray | None = None
    beside: Remainder | None = None  # What the model's data have of K beside all this, as known as they are

    @cached_property
    def active(self) -> NDArray[np.int64]:
        """Indices of the parameters of theta that may move, shape (d_theta,)."""
        return np.flatnonzero(self.std > 0.0).astype(np.int64)

    @property
    def size(self) -> int:
        """Length of u: the parameters of theta that may move, the nominal numbers."""
        return self.active.size + len(self.nominal)

    @property
    def own(self) -> "Parametrisation":
        """The parametrisation without what the model's order leaves out, on the same theta."""
        return replace(self, blocks=tuple(block for block in self.blocks if not block.rest), beside=None)

    def nominal_change(self, u: FloatArray) -> FloatArray:
        """Return the relative changes of the nominal numbers, shape (..., number of them)."""
        size = np.array([tolerance for _, _, tolerance, _ in self.nominal])
        at = np.array([place for *_, place in self.nominal], dtype=int)
        return np.asarray(size * np.sinh(np.clip(self.tail * u[..., at], -6.0, 6.0)) / self.tail)

    def rigid(self, u: FloatArray, inertia: FloatArray, stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return inertia and stiffness, shape (..., n, n), for u (..., d_u) and their nominal values (n, n)."""
        roots = {kind: np.ones((*u.shape[:-1], len(self.dofs))) for kind in ("inertia", "stiffness")}
        if self.nominal:
            change = self.nominal_change(u)
            for i, (kind, dof, _, _) in enumerate(self.nominal):
                if dof >= 0 and kind in roots:
                    roots[kind][..., dof] = np.sqrt(np.maximum(1.0 + change[..., i], 0.05))
        return (roots["inertia"][..., :, None] * inertia * roots["inertia"][..., None, :],
                roots["stiffness"][..., :, None] * stiffness * roots["stiffness"][..., None, :])

    def gain(self, what: str, u: FloatArray) -> FloatArray:
        """Return the gain of the motion sensors, "sensor", or of X, "force", of each motion, shape (..., n)."""
        out = np.ones((*u.shape[:-1], len(self.dofs)))
        change = self.nominal_change(u) if self.nominal else out
        for i, (kind, dof, _, _) in enumerate(self.nominal):
            if kind == what and dof >= 0:
                out[..., dof] += change[..., i]
        return np.maximum(out, 0.05)

    def with_nominal(self, tolerance: Mapping[str, float], mass: FloatArray) -> "Parametrisation":
        """Return the same with inertia, stiffness and gains of each degree of freedom free in their tolerance.

        `tolerance`: relative standard deviations: mass, A_inf, stiffness, sensor, force. `mass` (n, n): rigid-body
        inertia; that of mass and that of A_inf move the same number.
        """
        rows = []
        for j in range(len(self.dofs)):
            m, a = mass[j, j], self.A_inf[j, j]
            inertia = float(np.hypot(tolerance["mass"] * m, tolerance["A_inf"] * a) / (m + a))
            rows += [("inertia", j, inertia)]
            rows += [(kind, j, tolerance[kind]) for kind in ("stiffness", "sensor", "force")]
        wanted = [row for row in rows if row[2] > 0.0]
        first = self.active.size
        return replace(self, nominal=tuple((*row, first + i) for i, row in enumerate(wanted)))

    def part(self, dofs: Sequence[int]) -> "Parametrisation":
        """Return the parametrisation of some degrees of freedom, on the same theta; others do not enter it."""
        where = {j: i for i, j in enumerate(dofs)}
        blocks = []
        for block in self.blocks:
            keep = [e for e, (j, k) in enumerate(block.entries) if j in where and k in where]
            if keep:
                blocks.append(replace(block, entries=tuple((where[block.entries[e][0]], where[block.entries[e][1]])
                                                           for e in keep),
                                      places=tuple(block.places[e] for e in keep)))
        nominal = tuple((kind, where.get(j, -1), tolerance, at) for kind, j, tolerance, at in self.nominal)
        return replace(self, dofs=tuple(self.dofs[j] for j in dofs), A_inf=self.A_inf[np.ix_(dofs, dofs)],
                       blocks=tuple(blocks), nominal=nominal, beside=self.beside and self.beside.part(list(dofs)))

    @property
    def involved(self) -> NDArray[np.bool_]:
        """Which entries of u enter the blocks or the degrees of freedom, shape (d_u,)."""
        used = np.zeros(self.mean.size, dtype=bool)
        for block in self.blocks:
            used[block.denominator] = True
            for number in range(len(block.entries)):
                used[block.numerator(number)] = True
        nominal = [j >= 0 for _, j, _, _ in self.nominal]
        return np.r_[used[self.active], nominal].astype(bool)

    def theta(self, u: ArrayLike) -> FloatArray:
        """Return theta of standardised parameters u ~ N(0, 1), shapes (..., d_u) -> (..., d)."""
        u = np.asarray(u, dtype=float)
        theta = np.broadcast_to(self.mean, (*u.shape[:-1], self.mean.size)).copy()
        own = u[..., :self.active.size]
        theta[..., self.active] += own * self.std[self.active] if self.root is None else own @ self.root.T
        return self.tied(theta)

    def carried(self, u: FloatArray, other: "Parametrisation") -> FloatArray:
        """Return the u, shape (..., d_u), that give the theta that u gives under another prior."""
        moved = (other.theta(u) - self.mean)[..., self.active]
        own = moved / self.std[self.active] if self.root is None else np.linalg.solve(self.root, moved.T).T
        return np.concatenate([own, u[..., self.active.size:]], axis=-1)

    def tied(self, theta: FloatArray) -> FloatArray:
        """Return theta, shape (..., d), with the first numerators that K(0) = 0 asks for."""
        theta = np.array(theta)
        for block in self.blocks:
            if not block.zero:
                continue
            q = 2 * block.quadratic
            at_zero = np.r_[0:q:2, q:block.order] if block.form == "sections" else [0]  # c0 of sections, c of poles
            a = theta[..., block.denominator]
            for number in range(len(block.entries)):
                parts = theta[..., block.numerator(number)][..., at_zero] / a[..., at_zero]
                theta[..., block.numerator(number).start] = -a[..., 0] * parts[..., 1:].sum(axis=-1)
        return theta

    def denominators(self, theta: FloatArray, omega: FloatArray, block: ParameterBlock) -> ComplexArray:
        """Return P(iw) of a block, shape (..., nw)."""
        s = np.asarray(1j * omega, dtype=np.complex128)
        a = theta[..., block.denominator]
        if block.form == "polynomial":
            powers = _powers(s, block.order + 1)
            return np.asarray(powers[-1] + a @ powers[:-1])
        q = 2 * block.quadratic
        quadratic = s**2 + a[..., 1:q:2, None] * s + a[..., 0:q:2, None]
        return np.asarray(quadratic.prod(axis=-2) * (s + a[..., q:, None]).prod(axis=-2))

    def basis(self, theta: FloatArray, w: FloatArray, block: ParameterBlock) -> ComplexArray:
        """Return what the numerators of a block are factors of in K, shape (..., order, nw)."""
        s = np.asarray(1j * w, dtype=np.complex128)
        a, q = theta[..., block.denominator], 2 * block.quadratic
        if block.form == "polynomial":
            return np.asarray(_powers(s, block.order) / self.denominators(theta, w, block)[..., None, :])
        section = 1.0 / (s**2 + a[..., 1:q:2, None] * s + a[..., 0:q:2, None])
        pairs = np.stack([section, s * section], axis=-2).reshape(*theta.shape[:-1], q, w.size)
        return np.concatenate([pairs, 1.0 / (s + a[..., q:, None])], axis=-2)

    def slopes(self, theta: FloatArray, w: FloatArray) -> Iterator[tuple[slice, tuple[int, int], ComplexArray]]:
        """Yield of which parameters, of which entry (j, k), and dK_jk / d theta = dK_kj / d theta (order, nw).

        At theta (d,). All others are zero. Numerators that K(0) = 0 ties count as free.
        """
        for block in self.blocks:
            basis, q = self.basis(theta, w, block), 2 * block.quadratic
            for number, entry in enumerate(block.entries):
                terms = theta[block.numerator(number), None] * basis
                sums = terms.sum(axis=0) if block.form == "polynomial" else np.concatenate(
                    [np.repeat(terms[:q].reshape(-1, 2, w.size).sum(axis=1), 2, axis=0), terms[q:]])
                yield block.denominator, entry, -sums * basis
                yield block.numerator(number), entry, basis

    def K(self, theta: FloatArray, omega: ArrayLike) -> ComplexArray:
        """Return K(iw), shape (..., nw, n, n), for theta of shape (..., d)."""
        w = np.atleast_1d(np.asarray(omega, dtype=float))
        n = len(self.dofs)
        K = np.zeros((*theta.shape[:-1], w.size, n, n), dtype=complex)
        if self.beside is not None:
            K += self.beside.at(w)
        for block in self.blocks:
            basis = self.basis(theta, w, block)
            for number, (j, k) in enumerate(block.entries):
                entry = (theta[..., None, block.numerator(number)] @ basis)[..., 0, :]
                K[..., j, k] += entry
                if j != k:
                    K[..., k, j] += entry
        return K

    def stable(self, theta: FloatArray) -> NDArray[np.bool_]:
        """Return whether every pole of theta, shape (..., d), lies in the left half plane, shape (...)."""
        good = np.ones(theta.shape[:-1], dtype=bool)
        for block in self.blocks:
            a = theta[..., block.denominator]
            good &= (a > 0.0).all(axis=-1)
            if block.form == "polynomial" and block.order > 2:
                companion = np.zeros((*a.shape, block.order))
                companion[..., range(1, block.order), range(block.order - 1)] = 1.0
                companion[..., :, -1] = -a
                good &= np.linalg.eigvals(companion).real.max(axis=-1) < 0.0
        return good

    def realise(self, theta: FloatArray, method: str = "identified") -> RadiationFit:
        """Return the subsystem of theta, shape (d,), as a RadiationFit (controller form, one copy an input)."""
        return RadiationFit(self.dofs, *self.state_space(theta), order=max(block.order for block in self.blocks),
                            A_inf=self.A_inf, method=method)

    def state_space(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (a, b, c), shapes (..., r, r), (r, n), (..., n, r), of the subsystem of theta, shape (..., d)."""
        copies = [(block, k) for block in self.blocks for k in sorted({k for entry in block.entries for k in entry})]
        n, r, lead, end = len(self.dofs), sum(block.order for block, _ in copies), theta.shape[:-1], 0
        a, b, c = np.zeros((*lead, r, r)), np.zeros((r, n)), np.zeros((*lead, n, r))
        for block, k in copies:
            at, end = slice(end, end + block.order), end + block.order
            a[..., at, at], scale = self._dynamics(theta, block)
            b[at, k] = self._input(block)
            for number, entry in enumerate(block.entries):
                if k in entry:
                    c[..., entry[0] if entry[1] == k else entry[1], at] = theta[..., block.numerator(number)] * scale
        return a, b, c

    def _dynamics(self, theta: FloatArray, block: ParameterBlock) -> tuple[FloatArray, FloatArray]:
        """Return a block's state matrix, and the factors that turn its numerator into the output row."""
        a, r, q = theta[..., block.denominator], block.order, 2 * block.quadratic
        matrix = np.zeros((*a.shape, r))
        if block.form == "polynomial":
            # Scaled by a fixed frequency, so that states of high order keep comparable sizes.
            w0 = self.mean[block.start] ** (1.0 / r)
            powers = w0 ** (np.arange(r) - float(r))
            matrix[..., :-1, 1:] = w0 * np.eye(r - 1)
            matrix[..., -1, :] = -w0 * a * powers
            return matrix, powers
        first, second, single = np.arange(0, q, 2), np.arange(1, q, 2), np.arange(q, r)
        matrix[..., first, second] = 1.0
        matrix[..., second, first], matrix[..., second, second] = -a[..., first], -a[..., second]
        matrix[..., single, single] = -a[..., single]
        return matrix, np.ones(r)

    def _input(self, block: ParameterBlock) -> FloatArray:
        """Return a block's input column."""
        column = np.zeros(block.order)
        if block.form == "polynomial":
            column[-1] = self.mean[block.start] ** (1.0 / block.order)
        else:
            column[1:2 * block.quadratic:2] = 1.0
            column[2 * block.quadratic:] = 1.0
        return column


def _powers(s: ComplexArray, count: int) -> ComplexArray:
    """Return s^0 ... s^(count - 1), shape (count, nw), by products."""
    return np.asarray(np.cumprod([np.ones_like(s), *[s] * (count - 1)], axis=0))
