"""Which subsystems are passive, and the nearest one that is."""

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.filter.members import least_distance
from radiation_ss.fit.certificate import PASSIVE
from radiation_ss.inference.parameters import Parametrisation


def frequencies(form: Parametrisation, count: int = 120) -> FloatArray:
    """Return 0 and frequencies [rad/s] from far below the slowest pole of the prior mean to far above its fastest."""
    sizes = np.abs(np.linalg.eigvals(form.realise(form.mean).a))
    return np.r_[0.0, np.geomspace(0.02 * sizes.min(), 50.0 * sizes.max(), count)]


def passive(form: Parametrisation, theta: FloatArray, slack: float = PASSIVE, chunk: int = 200) -> np.ndarray:
    """Return whether the Hermitian part of K is positive semidefinite, shape (S,), for theta of shape (S, d).

    Of each degree of freedom a share `slack` of its largest damping may be missing.
    """
    omega, out = frequencies(form), np.zeros(theta.shape[0], dtype=bool)
    for start in range(0, theta.shape[0], chunk):
        damping = form.K(theta[start:start + chunk], omega).real
        size = np.sqrt(np.abs(np.einsum("swjj->swj", damping)).max(axis=1)) + 1e-300
        damping = damping / (size[:, None, :, None] * size[:, None, None, :]) + slack * np.eye(len(form.dofs))
        out[start:start + chunk] = (np.linalg.eigvalsh(damping)[..., 0] >= 0.0).all(axis=1)
    return out


def nearest_passive(form: Parametrisation, theta: FloatArray, draws: FloatArray,
                    matters: float = 0.5) -> tuple[FloatArray, str]:
    """Return theta, moved as little as needed to be passive (certified), and what was done, "" if nothing that matters.

    Least is the move that the draws (S, d) think most probable; where that is not found, on the way to the nearest
    passive draw, or to the prior mean. A move of K below `matters` of its standard deviations says nothing of model or
    records.
    """
    certificate = form.realise(theta).certificate
    if certificate.passive:
        return theta, ""
    where = f"negative damping at {certificate.worst_omega:.3g} rad/s" if certificate.stable else "an unstable pole"
    moved = most_probable_passive(form, theta, draws)
    if moved is None:
        moved = towards_passive(form, theta, draws)
    if moved is None:
        return theta, f"the fit of the mean parameters has {where}, and no passive one was found near it"
    omega = frequencies(form)
    K, change = form.K(draws, omega), form.K(moved, omega) - form.K(theta, omega)
    floor = 1e-3 * np.abs(K).max(axis=(0, 1))       # next to nothing beside the entry's largest
    away = float((np.abs(change) / np.maximum(np.maximum(K.std(axis=0), floor), 1e-300)).max())  # an entry may be 0
    if away < matters:
        return moved, ""
    share = np.linalg.norm(change) / np.linalg.norm(form.K(theta, omega))
    return moved, (f"the fit of the mean parameters has {where}; the fit handed on is passive, its K {100 * share:.2g} "
                   f"% away, {away:.2g} of its standard deviations at most")


def most_probable_passive(form: Parametrisation, theta: FloatArray, draws: FloatArray,
                          rounds: int = 40) -> FloatArray | None:
    """Return the passive parameters nearest to theta by the draws' covariance; None if not reached in these rounds.

    By cuts: wherever the damping is negative, its least eigenvalue is asked to rise to zero, linear in the parameters;
    the least move that meets all cuts so far (Lawson and Hanson 1974, chapter 23) is the next place.
    """
    spread = np.where(draws.std(axis=0) > 0.0, draws.std(axis=0), 1.0)
    _, size, axes = np.linalg.svd((draws - draws.mean(axis=0)) / spread, full_matrices=False)
    used = size > 1e-6 * size[0]
    steps = (size[used, None] / np.sqrt(draws.shape[0]) * axes[used]) * spread      # one deviation along each axis
    omega, z, cuts = frequencies(form), np.zeros(steps.shape[0]), list[tuple[FloatArray, float]]()
    scale = np.sqrt(np.abs(np.einsum("wjj->wj", form.K(theta, omega).real)).max(axis=0)) + 1e-300
    for _ in range(rounds):
        at = form.tied(theta + z @ steps)
        certificate = form.realise(at).certificate
        if certificate.passive:
            return at
        if not certificate.stable:
            return None
        w = np.sort(np.r_[omega, 30.0 * omega[-1], min(certificate.worst_omega, 30.0 * omega[-1])])
        least, vectors = np.linalg.eigh(form.K(at, w).real / np.outer(scale, scale))
        negative = least[:, 0] < -1e-13             # at rest rounding alone
        low = np.flatnonzero(negative & (least[:, 0] <= np.r_[np.inf, least[:-1, 0]])
                             & (least[:, 0] <= np.r_[least[1:, 0], np.inf]))
        low = np.union1d(low, np.flatnonzero(negative)[-1:])    # the tail, else pushed out step by step
        slopes = (form.K(form.tied(at + 1e-5 * steps), w[low]) - form.K(at, w[low])).real / 1e-5
        for i, k in enumerate(low):
            v = vectors[k, :, 0] / scale
            slope = np.einsum("j,ajk,k->a", v, slopes[:, i], v)
            cuts.append((slope, float(slope @ z) - least[k, 0]))
        found = least_distance(*map(np.array, zip(*cuts))) if cuts else None
        if found is None:
            return None
        z = found
    return None


def towards_passive(form: Parametrisation, theta: FloatArray, draws: FloatArray) -> FloatArray | None:
    """Return the first passive parameters on the way to the nearest passive draw, else to the prior mean."""
    spread = np.where(draws.std(axis=0) > 0.0, draws.std(axis=0), 1.0)
    order = np.argsort(np.sum(((draws - theta) / spread) ** 2, axis=1))
    goal = next((draws[i] for i in order[passive(form, draws[order])] if form.realise(draws[i]).passive), form.mean)
    if not form.realise(goal).passive:
        return None
    low, high = 0.0, 1.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        inside = form.realise(form.tied(theta + middle * (goal - theta))).passive
        low, high = (low, middle) if inside else (middle, high)
    return form.tied(theta + high * (goal - theta))
