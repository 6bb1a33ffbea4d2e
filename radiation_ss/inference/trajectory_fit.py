"""Fits of simulated trajectories: Levenberg's method, linear theory about a fit, and its most probable sizes."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve, cholesky
from scipy.optimize import minimize_scalar

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, SolverError
from radiation_ss.inference.candidates import Candidate, FittedSet, from_regression
from radiation_ss.inference.linear_model import Normal, bounded_step
from radiation_ss.inference.odds import SearchRules
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.score import Score, log_factors, products
from radiation_ss.inference.trajectory import Trajectories


@dataclass(frozen=True)
class FitRules:
    """What stops a trajectory fit."""

    iterations: int = 12  # How often derivatives are taken anew at most
    starts: int = 6  # Of a set, the lowest ones, that race at most
    agreed: int = 3  # Starts that come to the lowest point before no others are tried
    alike: float = 0.5  # Difference in cost up to which two starts have come to the same point
    gain: float = 1e-3  # Relative decrease of the cost below which it stops
    last: float = 1e-5  # The same of the fit whose numbers are told
    kept: float = 0.1  # Relative decrease of the cost above which derivatives serve for another step
    promise: float = 1.0  # Log odds by linear theory from which a set that is not known of is weighed
    rival: float = -3.0  # The same of a set with another effect in the place of one, once no set is better
    sets: int = 40  # Sets that are weighed at most: of records that no set explains each one is as good a start
    misfit: float = 2.0  # Factor of the errors from which simulations lack something that the equation error has


@dataclass(frozen=True, eq=False)
class Added:
    """What terms of as many strengths each add to weighted readings, X: X'e and X'X in units of their priors, and J'X.

    `cross`, J'X, has the shape (unknowns, terms strengths); `lower` (terms, strengths) are the strengths' bounds.
    """

    score: Score
    cross: FloatArray
    lower: FloatArray


@dataclass(frozen=True, eq=False)
class Theory:
    """Linear theory about a fit at one common factor of the tolerances.

    `scale` multiplies the fit's unknowns; `optimum` is where they would be, `covariance` theirs, `evidence` the log
    evidence without a common constant.
    """

    scale: FloatArray
    optimum: FloatArray
    covariance: FloatArray
    evidence: float

    @classmethod
    def about(cls, trial: Trajectories, q: FloatArray, now: Normal, tolerance: float, rules: SearchRules) -> "Theory":
        """Return the theory about the unknowns q of a simulation, with its normal equations there."""
        factor, g, scale = at_tolerance(trial, q, now, tolerance)
        covariance = factor.solve(np.eye(q.size))
        return cls(scale, covariance @ g, covariance, log_evidence(factor, g, tolerance, rules))

    def without(self, out: np.ndarray) -> "Theory":
        """Return the theory without some unknowns."""
        if not out.size:
            return self
        known, lost = self.optimum[out], self.covariance[out]
        inverse = np.linalg.inv(lost[:, out])
        change = -0.5 * known @ inverse @ known + 0.5 * np.linalg.slogdet(inverse)[1]
        return Theory(self.scale, self.optimum - lost.T @ (inverse @ known), self.covariance - lost.T @ inverse @ lost,
                      self.evidence + float(change))

    def beside(self, added: Added, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return of each term beside the fit the log evidence, its strengths, and what the optimum moves for each.

        Shapes (terms,), (terms, strengths) and (unknowns, terms strengths).
        """
        cross, k = self.scale[:, None] * added.cross, added.lower.shape[1]
        slope = added.score.slope - (added.cross.T @ (self.scale * self.optimum - q)).reshape(-1, k)
        moved = self.covariance @ cross
        information = added.score.information - products(cross, moved, k)
        told = np.isfinite(information.sum(axis=(1, 2)))
        # Round-off may make what the data do not tell negative.
        values, vectors = np.linalg.eigh(np.where(np.reshape(told, (-1, 1, 1)), information, 0.0))
        information = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
        strengths = np.maximum(np.linalg.solve(information + np.eye(k), slope[:, :, None])[:, :, 0], added.lower)
        gain = log_factors(Score(added.score.at, slope, information), added.lower)
        return np.where(told, self.evidence + gain, -np.inf), strengths, moved

    def moved_by(self, strengths: FloatArray, moved: FloatArray) -> FloatArray:
        """Return the unknowns of the fit beside some strengths, (k,), with what the optimum moves for each."""
        return np.asarray(self.scale * (self.optimum - moved @ strengths))


@dataclass(frozen=True, eq=False)
class Factor:
    """Cholesky's factor of a positive matrix with a unit diagonal, and the roots of the diagonal that it had."""

    lower: FloatArray
    root: FloatArray

    @classmethod
    def of(cls, matrix: FloatArray, round_off: float = 1e-13) -> "Factor":
        """Factorise; the diagonal grows by a share `round_off`, so that sums of squares far apart stay positive."""
        root = np.sqrt(np.diag(matrix))
        return cls(cholesky(matrix / np.outer(root, root) + round_off * np.eye(root.size), lower=True), root)

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant."""
        return 2.0 * float(np.log(np.diag(self.lower) * self.root).sum())

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution for right sides (size,) or (size, k)."""
        root = self.root if right.ndim == 1 else self.root[:, None]
        return np.asarray(cho_solve((self.lower, True), right / root) / root, dtype=np.float64)


def covariance_of(now: Normal) -> FloatArray:
    """Return the inverse of the information, whose diagonal no round-off makes negative."""
    return Factor.of(now.information).solve(np.eye(now.information.shape[0]))


def at_tolerance(trial: Trajectories, q: FloatArray, now: Normal,
                 tolerance: float) -> tuple[Factor, FloatArray, FloatArray]:
    """Return information and right side of linear theory at a factor of the tolerances, and the scale of unknowns."""
    A, scale = now.information - np.eye(q.size), trial.in_units_of(tolerance)
    return (Factor.of(scale[:, None] * A * scale + np.eye(q.size)), scale * (now.slope + q + A @ q), scale)


def log_evidence(factor: Factor, g: FloatArray, tolerance: float, rules: SearchRules) -> float:
    """Return the log evidence of linear theory, without a common constant."""
    return float(0.5 * (g @ factor.solve(g) - factor.log_determinant - (tolerance / rules.sizes.tolerance) ** 2))


def with_sizes(trial: Trajectories, q: FloatArray, now: Normal, rules: SearchRules, fit: FitRules,
               rounds: int = 3, accuracy: float = 0.1) -> tuple[Trajectories, FloatArray, Normal]:
    """Return the fit at the most probable sizes: the tolerances' common factor, and those of the errors.

    By linear theory about a fit, and fitted anew, until no logarithm changes by `accuracy`, `rounds` times at most.
    """
    largest = float(np.log(rules.sizes.largest))
    for _ in range(rounds):
        def negative(tolerance: float) -> float:
            factor, g, _ = at_tolerance(trial, q, now, tolerance)  # noqa: B023
            return -log_evidence(factor, g, tolerance, rules)

        tolerance = float(minimize_scalar(negative, bounds=(0.0, largest), options={"xatol": 0.02}).x)
        noise = likely_noise(trial, now, rules)
        done = max(abs(tolerance - trial.tolerance), np.abs(np.log(noise / trial.noise)).max()) < accuracy
        new = trial.tolerating(tolerance).with_noise(noise)
        reached = lowest(new, q / trial.in_units_of(tolerance), fit)
        if reached is None:
            break
        trial, (q, now) = new, reached
        if done:
            break
    return trial, q, now


def squares_of(trial: Trajectories, now: Normal) -> tuple[FloatArray, FloatArray]:
    """Return the sums of squares of each motion's weighted errors (n,), with what the unknowns' variance adds.

    And the numbers of rows, each of the power of its likelihood.
    """
    covariance = covariance_of(now)
    total, count = np.zeros((2, trial.noise.size))
    for error, (J, at), (factors, power) in zip(now.errors, now.parts, trial.counted()):
        square = error**2 + np.einsum("ij,jk,ik->i", J, covariance[np.ix_(at, at)], J, optimize=True)
        total += np.bincount(factors, square, total.size)
        count += np.bincount(factors, power, total.size)
    return total * trial.noise**2, count


def likely_noise(trial: Trajectories, now: Normal, rules: SearchRules) -> FloatArray:
    """Return the most probable factors of the errors' standard deviations about a fit, (n,)."""
    squares, count = squares_of(trial, now)
    found = np.ones(squares.size)

    def negative(log: float, i: int) -> float:
        return float(count[i] * log + 0.5 * squares[i] * np.exp(-2.0 * log) + 0.5 * (log / rules.sizes.noise) ** 2)

    for i in np.flatnonzero(count):
        found[i] = np.exp(minimize_scalar(negative, bounds=(-5.0, 8.0), args=(int(i),)).x)
    return found


def log_noise(trial: Trajectories, now: Normal, noise: FloatArray, rules: SearchRules, errors: bool = False) -> float:
    """Return the log density of errors of some standard deviations, of none or as they are, and of the factors."""
    squares, count = squares_of(trial, now)
    log = np.log(noise)
    return float(-count @ log - 0.5 * np.sum((log / rules.sizes.noise) ** 2) - 0.5 * errors * (squares @ noise**-2.0))


def fit_trajectories(problem: EquationError, candidate: Candidate, tolerance: dict[str, float],
                     search: SearchRules, rules: FitRules) -> FittedSet:
    """Return a candidate's numbers fitted by trajectories; those of the equation error where that fails.

    Levenberg's method with exact derivatives, which are kept as long as they serve, and physical bounds by projection,
    at the most probable sizes. Records whose motion is given are predicted by the equation error itself.
    """
    rules = replace(rules, gain=rules.last)
    fallback = from_regression(problem, candidate, tolerance)
    if not any(run.driven for run in problem.runs):
        return fallback
    try:
        trial = Trajectories(problem, candidate, tolerance).tolerating(0.0)
    except InputError:  # steps too short to be made, by the candidate's numbers
        return fallback
    starts = [trial.start()]
    if candidate.point is not None:  # the motion's starts that go with numbers found with others
        begun = trial.start(candidate.point)
        own = lowest(trial.held(begun), begun, rules)
        starts += [] if own is None else [own[0]]
    reached = lowest(trial, min(starts, key=trial.cost), rules)
    if reached is None:
        return fallback
    trial, q, now = with_sizes(trial, *reached, search, rules)
    squares, count = squares_of(trial, now)
    if np.any(squares > rules.misfit**2 * count):
        return fallback
    try:
        return numbers_at(trial, q, covariance_of(now))
    except np.linalg.LinAlgError:
        return fallback


def numbers_at(trial: Trajectories, q: FloatArray, covariance: FloatArray) -> FittedSet:
    """Return the numbers at a point."""
    p, std = trial.parameters(q), np.zeros(trial.base.size)
    std[trial.free] = trial.sd * np.sqrt(np.diag(covariance)[: trial.free.size])
    parts, spreads = (np.split(x, trial.rollout.offsets[1:-1]) for x in (p, std))
    actives = [a.with_values(x.tolist()) for a, x in zip(trial.actives, parts)]
    own, effects, stds = len(trial.first.nominal), list(trial.first.effects), list(trial.first.effects_std)
    for k, active, own_std in zip(trial.kept, actives[own:], spreads[own:]):
        effects[k], stds[k] = active, tuple(own_std.tolist())
    return FittedSet(tuple(actives[:own]), tuple(effects), tuple(float(s[0]) for s in spreads[:own]), tuple(stds))


def lowest(trial: Trajectories, q: FloatArray, rules: FitRules) -> tuple[FloatArray, Normal] | None:
    """Return the lowest point that is reached from one, and its normal equations; None if the motion grows.

    Without iterations the derivatives are those at the start.
    """
    try:
        damping, now = 1.0, trial.at(q)
        for left in reversed(range(rules.iterations + 1)):
            before, (q, now, damping) = now.cost, better(trial, q, now, damping, rules.gain)
            if before - now.cost < rules.gain * now.cost:
                break
            while before - now.cost > rules.kept * now.cost:
                before, (q, now, _) = now.cost, better(trial, q, now, damping, rules.gain, tries=1)
            now = trial.at(q, now.errors) if left else now
    except (SolverError, np.linalg.LinAlgError):
        return None
    return q, now


def better(trial: Trajectories, q: FloatArray, now: Normal, damping: float, gain: float,
           tries: int = 8) -> tuple[FloatArray, Normal, float]:
    """Return a better point, its normal equations and the damping to go on with.

    The point itself if there is none, or linear theory promises less than a relative `gain`.
    """
    for _ in range(tries):
        # The unknowns are in units of their priors: what the data hardly tell is not held back more than by its prior.
        new = bounded_step(now.information + damping * np.eye(q.size), now.slope, q, trial.inside)
        if (new - q) @ (2.0 * now.slope - now.information @ (new - q)) < gain * now.cost:
            break
        try:
            found = trial.near(new, now)
        except SolverError:
            found = now
        if found.cost < now.cost:
            return new, found, max(damping / 10.0, 1e-9)
        damping *= 10.0
    return q, now, damping
