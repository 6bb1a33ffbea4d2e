"""The fitting problem of one block of degrees of freedom, scaled to numbers of order one, and the errors of a fit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import Akima1DInterpolator

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.fit.causal import scales
from radiation_ss.fit.rational import connected
from radiation_ss.hydro.data import HydroData


@dataclass(frozen=True, eq=False)
class Problem:
    """Samples of a symmetric K(iw) of m degrees of freedom, scaled: s = rate x, K = scale_i scale_j K'."""

    dofs: tuple[str, ...]
    x: FloatArray  # (nw,): Frequencies over `rate`
    K: ComplexArray  # (nw, p): Upper triangle of the scaled samples, p = m (m + 1) / 2, row by row
    # (nw, p): Weight of each residual; the root of 2 of entries off the diagonal, which stand for two, included
    weight: FloatArray
    rate: float  # Half the highest frequency [rad/s]
    scale: FloatArray  # (m,)
    # x_points, K_points (q,), (q, p): Where K is to be met exactly, x = 0 among them if a value of K(0) was asked
    x_points: FloatArray
    K_points: ComplexArray
    zero: bool  # K(0) = 0
    # Smallest damping rate (-Re of a pole) that the spacing of the frequencies can resolve, over `rate`
    narrowest: float = 0.0

    @property
    def m(self) -> int:
        """Number of degrees of freedom."""
        return len(self.dofs)

    @property
    def norm(self) -> float:
        """Weighted norm of the samples."""
        return float(np.linalg.norm(self.weight * self.K))

    @property
    def end(self) -> float:
        """Highest frequency of the data over `rate`."""
        return 2.0

    @property
    def fastest(self) -> float:
        """Largest pole over `rate` that the band can tell from a feedthrough, which K does not have: ten times it."""
        return 10.0 * self.end

    def without_points(self) -> "Problem":
        """Return the problem without frequency points and without a value of K(0)."""
        return replace(self, x_points=self.x_points[:0], K_points=self.K_points[:0])

    def whole(self, upper: NDArray) -> NDArray:
        """Return symmetric matrices (q, m, m) from upper triangles (q, p)."""
        i, j = np.triu_indices(self.m)
        full = np.empty((upper.shape[0], self.m, self.m), dtype=upper.dtype)
        full[:, i, j] = full[:, j, i] = upper
        return full

    def rounded(self, digits: int = 9) -> "Problem":
        """Return the problem of samples rounded, which are the same whatever the scale of the body."""
        return replace(self, x=self.x.round(digits + 3), K=self.K.round(digits), weight=self.weight.round(digits),
                       K_points=self.K_points.round(digits), narrowest=round(self.narrowest, digits + 3))

    def turned(self, order: NDArray[np.intp], signs: FloatArray) -> "Problem":
        """Return the problem of the motions in another order, each with a sign."""
        i, j = np.triu_indices(self.m)

        def moved(upper: NDArray, sign: NDArray) -> NDArray:
            return np.asarray((self.whole(upper)[:, order][:, :, order] * sign)[:, i, j])

        signed, even = np.outer(signs, signs), np.ones((self.m, self.m))
        return replace(self, dofs=tuple(self.dofs[k] for k in order), scale=self.scale[order], K=moved(self.K, signed),
                       K_points=moved(self.K_points, signed), weight=moved(self.weight, even))

    def continued(self, growth: float = 0.2) -> "Problem":
        """Return the problem with what is expected above the band, up to ten times it: together as one more sample.

        K falls there as 1 / frequency, as it does where the kernel starts with a step. The samples' distance grows.
        """
        first = float(np.diff(self.x).mean())
        x = [self.end + first]
        while x[-1] < self.fastest:
            x.append(x[-1] + first + growth * (x[-1] - self.end))
        at = np.array(x)
        K = self.K[-1] * (self.x[-1] / at[:, None])
        weight = np.broadcast_to(self.weight.max(axis=0) / np.sqrt(at.size), K.shape)
        return replace(self, x=np.r_[self.x, at], K=np.vstack([self.K, K]), weight=np.vstack([self.weight, weight]))

    def thinned(self, most: int = 200, least: int = 60) -> "Problem":
        """Return the problem of every k-th sample: about `most` / m of them, `least` or more; it resolves less."""
        step = -(-self.x.size // max(least, most // self.m))
        return self if step == 1 else replace(self, x=self.x[::step], K=self.K[::step], weight=self.weight[::step],
                                              narrowest=step * self.narrowest)

    def misfit(self, K: ComplexArray) -> float:
        """Return the weighted sum of squares between the samples and K, upper triangles (nw, p)."""
        return float(np.sum(np.abs(self.weight * (K - self.K)) ** 2))

    def along(self, V: FloatArray) -> "Problem":
        """Return the problem of the orthonormal motions V (m, k), each frequency with its diagonal's mean weight."""
        i, j = np.triu_indices(V.shape[1])
        K, K_points = ((V.T @ self.whole(part) @ V)[:, i, j] for part in (self.K, self.K_points))
        names = tuple(self.dofs[k] for k in np.abs(V).argmax(axis=0))
        weight = np.sqrt(np.mean(self.weight[:, np.equal(*np.triu_indices(self.m))] ** 2, axis=1, keepdims=True))
        return replace(self, dofs=names, K=K, K_points=K_points, scale=np.ones(V.shape[1]),
                       weight=weight * np.where(i == j, 1.0, np.sqrt(2.0)))


def symmetric_parts(problem: Problem, exact: float = 1e-6) -> list[tuple[Problem, FloatArray]]:
    """Return the parts, each with its orthonormal motions V (m, k), between which V^T K V is zero within `exact`: the
    eigenvectors of one combination of all samples lie in them.
    """
    samples = np.concatenate([problem.whole(problem.K), problem.whole(problem.K_points)])
    share = np.random.default_rng(0).uniform(0.5, 1.5, (2, samples.shape[0]))
    _, V = np.linalg.eigh(np.tensordot(share[0], samples.real, 1) + np.tensordot(share[1], samples.imag, 1))
    coupled = np.abs(V.T @ samples @ V).max(axis=0)
    floor = exact * float(coupled.max())
    groups = [group for group in connected(coupled > floor) if coupled[np.ix_(group, group)].max() > floor]
    if len(groups) == 1 and len(groups[0]) == problem.m:
        return [(problem, np.eye(problem.m))]
    return [(problem.along(V[:, group]), V[:, group]) for group in groups]


def independent(problem: Problem, least: float = 0.1) -> int:
    """Return how many combinations of motions have a K of `least` of the largest: of a sphere's surge and pitch one."""
    sizes = np.linalg.svd(problem.whole(problem.K).reshape(-1, problem.m), compute_uv=False)
    return int(np.sum(sizes > least * sizes[0]))


def own_order(problem: Problem, digits: int = 9) -> tuple[NDArray[np.intp], FloatArray]:
    """Return an order and signs of the motions that are theirs whatever they are called and however axes point.

    Ascending means of |K_ii|; each sign makes the largest coupling with those before it, on average, positive.
    """
    mean = problem.whole(problem.K).mean(axis=0)
    order = np.argsort(np.abs(np.diag(mean)).round(digits), kind="stable")
    mean, signs = mean[np.ix_(order, order)], np.ones(problem.m)
    for k in range(1, problem.m):
        at = int(np.argmax(np.abs(mean[k, :k]).round(digits)))
        part = mean[k, at].real if abs(mean[k, at].real) > abs(mean[k, at].imag) else mean[k, at].imag
        signs[k] = signs[at] * (1.0 if part >= 0.0 else -1.0)
    return order, signs


def interpolated(x: FloatArray, K: ComplexArray, at: FloatArray, i: NDArray, j: NDArray) -> ComplexArray:
    """Return the entries i, j of K (nx, entries) at other frequencies: by a cubic without swings between the data's.

    By a straight line where the cubic's damping is not positive semidefinite and that of the data is.
    """
    straight = np.array([[np.interp(one, x, column) for column in K.T] for one in at], dtype=complex)
    if x.size < 3 or not at.size:
        return straight.reshape(at.size, K.shape[1])
    real, imag = (Akima1DInterpolator(x, part, method="makima")(at) for part in (K.real, K.imag))
    whole = np.zeros((at.size, i.max() + 1, j.max() + 1))
    whole[:, i, j] = whole[:, j, i] = real
    definite = np.linalg.eigvalsh(whole)[:, :1] >= 0.0
    return np.where(definite, real + 1j * imag, straight)


def check_size(problem: Problem, order: int, states: int, free: int) -> None:
    """Refuse K(0) = 0 or frequency points that ask for more than an order's states and free parameters."""
    name = ", ".join(problem.dofs)
    if problem.zero and order < 2:
        raise InputError(f"{name}: K(0) = 0 needs order 2 at least")
    equations = 2 * problem.K_points.size - int((problem.x_points == 0.0).sum()) * problem.K.shape[1]
    if equations > free:
        raise InputError(f"{name}: {problem.x_points.size} frequency point(s) are {equations} equations, more than "
                         f"order {order} can carry ({states} states, {free} numbers); raise the order or drop points")


def symmetric(data: HydroData) -> ComplexArray:
    """Return K(iw) with K_ij and K_ji averaged, shape (nw, n, n): radiation is reciprocal."""
    return 0.5 * (data.K + np.swapaxes(data.K, 1, 2))


def blocks_of(data: HydroData, coupled: float = 5e-3, strong: float = 0.2, reciprocal: float = 2.0) -> list[list[int]]:
    """Return the groups of coupled degrees of freedom as ascending positions; one that does not radiate is in none.

    A coupling counts where max_w |K_ij| exceeds `coupled` of the geometric mean of the diagonal's maxima and what K_ij
    and K_ji share is `reciprocal` times what they differ by (noise is not reciprocal), or where it exceeds `strong`.
    """
    K = data.K
    size = np.abs(symmetric(data)).max(axis=0)
    own = np.where(np.isinf(scales(data)), 0.0, np.sqrt(np.diag(size)))
    mean, half = (np.linalg.norm(K + sign * np.swapaxes(K, 1, 2), axis=0) for sign in (1.0, -1.0))
    pairs = np.outer(own, own)
    linked = (size > coupled * pairs) & (pairs > 0.0) & ((mean > reciprocal * half) | (size > strong * pairs))
    return [group.tolist() for group in connected(linked) if own[group[0]] > 0.0]


def block_problem(data: HydroData, block: list[int], *, at_zero: str | float | ArrayLike = "free",
                  points: FloatArray | None = None, weight: FloatArray | None = None, resolved: float = 0.5) -> Problem:
    """Return the scaled problem of the degrees of freedom at the positions of one block.

    `at_zero`: "free", "zero" or K(0) in SI. `points` (q,): where K, interpolated between the data, is to be met exactly
    [rad/s]. `resolved`: smallest damping rate of a resonance over the spacing of the frequencies: narrower ones would
    be invented.
    """
    square = np.ix_(block, block)
    i, j = np.triu_indices(len(block))
    samples = symmetric(data)[:, square[0], square[1]]
    size = np.abs(np.einsum("wii->wi", samples)).max(axis=0)
    scale, rate = np.sqrt(size), 0.5 * float(data.omega[-1])
    pairs = np.outer(scale, scale)[i, j]
    K = samples[:, i, j] / pairs
    root = np.ones(1) if weight is None else np.sqrt(weight)
    root = root[:, square[0], square[1]][:, i, j] if root.ndim == 3 else root[:, None]
    weights = root * np.where(i == j, 1.0, np.sqrt(2.0)) * np.ones(K.shape)
    x_points = np.zeros(0) if points is None else np.asarray(points) / rate
    K_points = interpolated(data.omega / rate, K, x_points, i, j)
    if not isinstance(at_zero, str):
        x_points = np.r_[0.0, x_points]
        K_points = np.vstack([_value_at_zero(at_zero, data, square)[i, j] / pairs, K_points])
    # The mean spacing of the frequencies, weighted by |K|^2: how finely the curve is sampled.
    power = np.sum(np.abs(K) ** 2 * np.where(i == j, 1.0, 2.0), axis=1)
    spacing = float(np.sum(np.gradient(data.omega) * power) / np.sum(power))
    return Problem(tuple(data.dofs[i] for i in block), data.omega / rate, K, weights, rate, scale,
                   x_points, K_points, isinstance(at_zero, str) and at_zero == "zero", resolved * spacing / rate)


def _value_at_zero(value: float | ArrayLike, data: HydroData, square: Sequence[NDArray[np.intp]]) -> FloatArray:
    matrix = np.asarray(value, dtype=float)
    if matrix.ndim == 0 and data.n == 1:
        matrix = matrix.reshape(1, 1)
    if matrix.shape != (data.n, data.n):
        raise InputError(f"at_zero: shape {matrix.shape} found; a number for one degree of freedom, "
                         f"else ({data.n}, {data.n}) [N s/m and so on]")
    part = matrix[square[0], square[1]]
    if np.linalg.eigvalsh(0.5 * (part + part.T))[0] < 0.0:
        raise InputError("at_zero: K(0) must be positive semidefinite, or no passive model can meet it")
    return np.asarray(part)


def joint_error(data: HydroData, K: ComplexArray, weight: FloatArray | None = None) -> float:
    """Return ||S^-1 (K_data - K) S^-1|| / ||S^-1 K_data S^-1|| over all samples and entries (Frobenius).

    `weight`, shape (nw,) or (nw, n, n), is that of the squares.
    """
    share = np.ones(1) if weight is None else np.sqrt(weight)
    pairs = np.outer(scales(data), scales(data))
    pairs = (share if share.ndim == 3 else share[:, None, None]) / pairs
    return float(np.linalg.norm(pairs * (data.K - K)) / np.linalg.norm(pairs * data.K))


def entry_errors(data: HydroData, K: ComplexArray) -> FloatArray:
    """Return ||K_ij,data - K_ij|| / ||K_ij,data|| for each entry, shape (n, n); NaN where data are zero or noise."""
    size, miss = np.linalg.norm(data.K, axis=0), np.linalg.norm(data.K - K, axis=0)
    there = (size > 0.0) & np.isfinite(np.outer(scales(data), scales(data)))
    return np.asarray(np.divide(miss, size, out=np.full(size.shape, np.nan), where=there))


def not_followed(data: HydroData, K: ComplexArray, weights: FloatArray | None) -> str:
    """Return words for the degrees of freedom of whose own |K_ii|^2 the model leaves more than half, else nothing.

    Where the mean of B_ii is negative, so is L(0+) = 2/pi int B dw (2), and no passive model is near.
    """
    said, silent = [], ~np.isfinite(scales(data))
    for i, dof in enumerate(data.dofs):
        weight = weights if weights is None or weights.ndim == 1 else weights[:, i:i + 1, i:i + 1]
        if silent[i] or joint_error(data.select(dof), K[:, i:i + 1, i:i + 1], weight) ** 2 <= 0.5:
            continue
        negative = np.trapezoid(data.B[:, i, i], data.omega) < 0.0
        said.append(f"the fit does not follow K of {dof}" + (
            ", whose damping B is negative on average: no passive model does; its sign may be turned" if negative else
            f" (error {entry_errors(data, K)[i, i]:.0%}); more states may help"))
    return "; ".join(said)
