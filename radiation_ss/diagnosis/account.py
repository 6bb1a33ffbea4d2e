"""The best set of effects with its numbers, fitted to some records, and the budget that it makes of others."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammainccinv

from radiation_ss.arrays import FloatArray
from radiation_ss.body.dynamics import impedance
from radiation_ss.body.model import Model
from radiation_ss.diagnosis.prediction import Error, Predictor, energy, without_slow
from radiation_ss.diagnosis.rules import Rules
from radiation_ss.diagnosis.shares import Budget, Row, budget
from radiation_ss.effects import Active
from radiation_ss.effects.nominal import OwnNumber, natural_frequency, simulated_numbers
from radiation_ss.inference.candidates import Candidate, FittedSet, from_regression, placed
from radiation_ss.inference.force_errors import recorded_force, recorded_noise
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.search import Found, solve_set
from radiation_ss.inference.sensor_noise import noise_of
from radiation_ss.inference.trajectory_fit import fit_trajectories
from radiation_ss.records.columns import QUANTITIES
from radiation_ss.records.record import Record
from radiation_ss.simulation.linear import exact_step, propagate
from radiation_ss.simulation.prepared import exciting_force


@dataclass(frozen=True, eq=False)
class Data:
    """What a conclusion is drawn from."""

    # fitted, unseen: Records that the effects were searched in, and records or parts of them that the budget is
    # measured on
    fitted: tuple[Record, ...]
    unseen: tuple[Record, ...]
    tolerated: dict[str, float]
    seed: int
    # Makes the problem of what numbers are fitted to for the budget, which is large; by default all that is fitted
    check: Callable[[], EquationError] | None = None
    withheld: EquationError | None = None  # Of records that no fit sees
    contradiction: float = 0.0  # By how much the model's coefficients contradict themselves, of their largest damping
    drifts: bool = False  # Whether a slow force of unknown course is among the effects to consider


@dataclass(frozen=True, eq=False)
class Fitted:
    """The best set with its numbers, and what predicts with them."""

    best: FittedSet
    candidate: Candidate
    errors: Predictor


def of_size(pair: Fitted, problem: EquationError, known: Sequence[Record], tolerated: dict[str, float],
            rules: Rules) -> tuple[Fitted, FloatArray]:
    """Return the best set without what closes too little to matter, and what each of its effects closes.

    Unless the model's own numbers have to take its place: two effects may multiply an equation together.
    """
    closed = contributions(pair, known)
    seen = np.maximum(closed, in_second_sensors(problem, pair.candidate))
    kept = [t for t, c in zip(pair.candidate.terms, seen) if c >= rules.matters]
    if len(kept) == len(pair.candidate.terms):
        return pair, closed
    candidate = solve_set(problem, kept, pair.candidate.posterior.sizes, rules.search)
    less = replace(pair, best=numbers(problem, candidate, tolerated, rules), candidate=candidate)
    own = simulated_numbers(problem.model, tolerated, force=problem.forced)
    if farthest(own, less) > rules.plausible >= farthest(own, pair):
        return pair, closed
    return less, contributions(less, known)


def farthest(own: Sequence[OwnNumber], pair: Fitted) -> float:
    """Return by how many stated tolerances the nominal number is off that is off most."""
    return max((abs(first(a)) / o.spread for o, a in zip(own, pair.best.nominal)), default=0.0)


def sizes_of(model: Model, data: Data) -> dict[tuple[str, int], float]:
    """Return the mean square of each motion in whole records: the part that is predicted may be its faint end.

    The places of a static test that are predicted lie among all others: they have a size of their own.
    """
    found = {}
    for record in (r for r in data.fitted if r.kind != "static"):
        for i, dof in enumerate(model.dofs):
            values = record.channels.get(dof if record.kind != "prescribed" else f"{dof}_force")
            if values is not None and np.isfinite(values).any():
                found[record.name, i] = float(np.nanmean(values**2))
    return found


def first(active: Active) -> float:
    """Return the value of an effect's first parameter."""
    return float(next(iter(active.values.values())))


def numbers(problem: EquationError, candidate: Candidate, tolerated: dict[str, float], rules: Rules) -> FittedSet:
    """Return a set's numbers by trajectories, with the wider of both standard deviations."""
    rough = from_regression(problem, candidate, tolerated)
    fine = fit_trajectories(problem, candidate, tolerated, rules.search, rules.fit)
    return replace(fine, effects_std=tuple(tuple(max(x, y) for x, y in zip(a, b))
                                           for a, b in zip(fine.effects_std, rough.effects_std)))


def predictable(model: Model, record: Record) -> bool:
    """Whether a record's force is known, so that its motion can be predicted."""
    return record.kind != "motion-only" and exciting_force(model, record) is not None


def curve_of(active: Active) -> str:
    """Return "damping" or "stiffness" of an effect that is a term of such a curve: a law of motion without memory."""
    effect = active.effect
    return effect.family if effect.family in ("damping", "stiffness") and not (effect.states or effect.needs) else ""


def account(found: Found, null: FittedSet, pair: Fitted, data: Data,
            slow: Sequence[Row], below: Mapping[tuple[str, int], float]) -> tuple[Budget, dict[str, list[Error]]]:
    """Return the budget on unseen records, and the predictions given, recalibrated and corrected.

    `null` is the set without effects; `slow` the drifts, `below` some frequencies in each record: they have a course of
    their own in each, so they explain an error and predict none.
    """
    problem, best = found.problem, pair.best
    model, unseen = problem.model, [r for r in data.unseen if predictable(problem.model, r)]
    problems = [problem, *([] if data.withheld is None else [data.withheld])]
    given = pair.errors((), unseen) if unseen else None
    if not given:
        return Budget((), 0.0, 0.0, 0.0, ()), {}
    predictions = {"given": given}

    def predict(parts: frozenset[int]) -> list[Error]:
        effects = [a for k, a in enumerate(best.effects) if k + 1 in parts]
        actives = [*(best.nominal if 0 in parts else ()), *effects]
        made: list[Error] = []
        for record in unseen:
            # A subset may be unstable without the rest: it is then as bad as the motion itself.
            errors = pair.errors(actives, [record])
            lost = [replace(e, error=e.measured) for e in given if e.record == record.name]
            made += lost if errors is None or any(grown(e) for e in errors) else errors
        return made

    causes = [Row("recalibration", "", 0.0, (0.0, 0.0))]
    causes += [Row(a.name, place(a), 0.0, (0.0, 0.0), found.inclusion.get(a.key, 0.0),
                   numbers_told(a, stds), curve_of(a))
               for a, stds in zip(best.effects, best.effects_std)]
    drifts = {len(causes) + k: {at: top for at, top in below.items() if model.dofs[at[1]] == row.dof}
              for k, row in enumerate(slow)}
    predictions["recalibrated"] = pair.errors(null.actives, unseen) or given
    predictions["corrected"] = predict(frozenset(range(len(causes))))
    noise = np.array([noise_level(problems, pair, error) for error in given])
    # A gap relative to a motion that its sensor cannot see is none.
    moving = {(run.record.name, int(i)) for each in problems for run in each.runs for i in np.flatnonzero(run.free)}
    seen = [k for k, (e, (sd, _)) in enumerate(zip(given, noise))
            if (e.record, e.dof) in moving and max(float(np.var(e.measured)), e.least**2) > sd**2]
    seen = seen or list(range(len(given)))

    def predict_seen(parts: frozenset[int]) -> list[Error]:
        errors = predict(parts)
        for k in parts & drifts.keys():
            errors = without_slow(errors, drifts[k])
        return [errors[k] for k in seen]

    block = 2.0 * 2.0 * np.pi / min(s.omega for s in problem.scales.values())
    return budget(causes, predict_seen, noise[seen], model.dofs, block, np.random.default_rng(data.seed),
                  sizes_of(model, data), slow), predictions


def grown(error: Error, times: float = 100.0) -> bool:
    """Whether a prediction has left the motion by so many times its size."""
    return bool(np.abs(error.error).max() > times * max(np.abs(error.measured).max(), error.least))


def numbers_told(active: Active, stds: Sequence[float]) -> dict[str, tuple[float, float]]:
    """Return the numbers of an effect that are fitted, and those of its shape that are chosen, with deviations."""
    chosen = {n for n, p in active.effect.parameters.items() if p.fixed and p.unit == "1" and active.values.get(n)}
    return {n: (v, s) for (n, v), s in zip(active.values.items(), stds) if s > 0.0 or n in chosen}


def place(active: Active) -> str:
    """Return the degree of freedom of an effect, or both."""
    return f"{active.dof},{active.other}" if active.other else active.dof


def noise_level(problems: Sequence[EquationError], pair: Fitted, error: Error) -> tuple[float, float]:
    """Return the standard deviation of noise a sample, in the record itself where a problem has it, and at most.

    The fit learns the noise in the band of the motion. Above it the noise is what the spectrum shows there, or no less
    than in the band. The noise of a recorded force moves what is predicted with it, by how much is chance at a narrow
    resonance. A force that is predicted has the noise of its own sensor, and that of the motion through the impedance.
    """
    if error.quantity == "force":
        return (driven_noise(problems, pair, error),) * 2
    problem, factor = problems[0], float(np.exp(pair.candidate.posterior.sizes.noise[error.dof]))
    step, levels = float(np.median(np.diff(error.time))), []
    measured = [run for each in problems for run in each.runs if run.free[error.dof]]
    for run in [run for run in measured if run.record.name == error.record] or measured:
        band = min(run.basis[0].omega[-1] * step / np.pi, 1.0)  # share of all frequencies that the samples resolve
        noise = run.noise[error.dof] ** 2
        own = band * factor**2 * noise.mean() + (1.0 - band) * max(factor, 1.0) ** 2 * noise[-1]
        own *= max(run.dt / step, 1.0)
        levels.append(np.sqrt(own + shaken(problem.model, run)[:, error.dof]))
    if not levels:
        return 0.0, 0.0
    order = QUANTITIES.index(error.quantity)
    mean, most = np.mean(levels, axis=0) * problem.scales[problem.model.dofs[error.dof]].omega ** order
    return float(mean), float(most)


def shaken(model: Model, run: MeasuredMotion) -> FloatArray:
    """Return the mean square of the displacements that noise of the recorded forces makes, and at most, (2, n).

    Of a white force of density S it is S int_0^T (1 - t / T) h(t)^2 dt, with the impulse response h; S is that at the
    natural frequency, where most of the response is. Its variance is that of independent components at the frequencies
    2 pi k / T, few of them at a narrow resonance; in one of forty records there is more than at most.
    """
    (F, G), mean, deviation = model.matrices(), np.zeros(model.n), np.zeros(model.n)
    first, left = F.shape[0] - 2 * model.n, 1.0 - np.arange(run.time.size) / run.time.size
    step = exact_step(F, G, run.dt)
    for j in range(model.n):
        sd = float(recorded_noise(model, run, j, np.array([natural_frequency(model, j)]))[0])
        if sd > 0.0:
            h = propagate(step, np.zeros((run.time.size, model.n)), G[:, j])[:, first:first + model.n]
            own, power = sd**2 * run.dt**2 * left @ h**2, np.abs(np.fft.rfft(h, axis=0)) ** 2
            mean += own
            share = power / np.maximum(power.sum(axis=0), 1e-300)
            deviation = np.hypot(deviation, own * np.sqrt((share**2).sum(axis=0)))
    most, moved = mean.copy(), deviation > 0.0
    count = (mean[moved] / deviation[moved]) ** 2
    most[moved] *= gammainccinv(count, 0.025) / count
    return np.stack([mean, most])


def driven_noise(problems: Sequence[EquationError], pair: Fitted, error: Error) -> float:
    """Return the standard deviation of noise in the force that a prescribed motion needs."""
    dof, factor = error.dof, float(np.exp(pair.candidate.posterior.sizes.noise[error.dof]))
    found = dict[str, float]()
    for problem in problems:
        for place in problem.places:
            run = problem.runs[place.record]
            if place.dof == dof and place.order < 0 and run.prescribed and run.force is not None:
                through = float(np.sum(problem.rows.noise[place.rows])) / run.places
                through += beyond(problem.model, run, dof)
                # A load's steps are no noise, and what it has of that is in the places' scatter along it.
                own = 0.0 if run.record.kind == "static" else noise_of(*recorded_force(problem.model, run, dof),
                                                                       run.omega[dof])
                found[run.record.name] = factor**2 * through + own**2 / max(run.kept, 1.0)
    return float(np.sqrt(found.get(error.record, np.mean([*found.values()] or [0.0]))))


def beyond(model: Model, run: MeasuredMotion, dof: int) -> float:
    """Return the variance of the force by noise of the motions above the basis, where they stand out of their noise."""
    top = float(run.basis[0].omega[-1])
    at = np.linspace(top, max(top, float(run.clear.max())), 50)
    density = run.noise[:, -1] ** 2 * run.dt / np.pi
    through = np.abs(impedance(model, at)[:, dof]) ** 2 * (at[:, None] <= run.clear) @ density
    return 0.0 if run.record.kind == "static" else float(np.trapezoid(through, at))


def in_second_sensors(problem: EquationError, candidate: Candidate) -> FloatArray:
    """Return how much of the second sensors' rms each effect of a set makes that is theirs alone; 0 of the others."""
    found = np.zeros(len(candidate.terms))
    for k, (term, at) in enumerate(placed(problem, candidate.terms)):
        for p in [p for p in problem.places if p.order >= 0 and not term.active.of_first_sensor]:
            size = np.sqrt(problem.runs[p.record].time.size) * problem.rows.scale[p.rows].max()
            made = np.linalg.norm(np.asarray(term.columns.values[p.rows]) @ candidate.posterior.mean[at])
            found[k] = max(found[k], float(made / size))
    return found


def contributions(pair: Fitted, fitted: Sequence[Record]) -> FloatArray:
    """Return how much of the motion's rms each effect of the best set accounts for in the records of the fit.

    No effect accounts for more than all of them: what two of them make against each other is no gap.
    """
    best = pair.best
    whole = pair.errors(best.actives, fitted) if fitted and best.effects else None
    if whole is None:
        return np.ones(len(best.effects))
    base = energy(whole).sum()

    def closed(kept: Sequence[Active]) -> float:
        without = pair.errors([*best.nominal, *kept], fitted)
        return 1.0 if without is None else float(np.sqrt(max(energy(without).sum() - base, 0.0)))

    most = closed(())
    return np.array([min(most, closed([a for j, a in enumerate(best.effects) if j != k]))
                     for k in range(len(best.effects))])
