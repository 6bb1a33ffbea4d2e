"""Which effects: spike and slab over any number of them, by best-first search (George & McCulloch 1993).

Six steps: (1) columns of every effect, place and start of its shape; (2) the set without effects; (3) a score test
ranks what may be added to the best sets; (4) the first few are solved with all sizes learned anew, and sets with one
effect less; (5) where nothing is left to add, each effect of the best set is exchanged for what may stand for it;
(6) until no set improves. Inclusion probabilities are sums over all sets that were solved.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.inference.candidates import Candidate, Key, Keys, Term, carried_over, placed, twins
from radiation_ss.inference.linear_model import Columns, Posterior, Sizes
from radiation_ss.inference.odds import SearchRules, in_likelier_widths, log_prior
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.regression import learn, solve
from radiation_ss.inference.score import gains, scores


@dataclass(frozen=True, eq=False)
class Found:
    """Result of a search.

    Parameters
    ----------
    problem : EquationError
    candidates : tuple of Candidate
        Best first.
    inclusion : mapping of (name, dof, other) to float
        Probability of each effect.
    terms : tuple of Term
        What the sets were chosen from.
    """

    problem: EquationError
    candidates: tuple[Candidate, ...]
    inclusion: dict[Key, float] = field(default_factory=dict)
    terms: tuple[Term, ...] = ()

    @property
    def null(self) -> Candidate:
        """The candidate without effects beyond those that are said to be present."""
        return min(self.candidates, key=lambda c: len(c.terms))

    def probabilities(self) -> FloatArray:
        """Return the probability of each candidate."""
        values = np.array([c.log_probability for c in self.candidates])
        weights = np.exp(values - values.max())
        return np.asarray(weights / weights.sum())

    def beside(self, others: Sequence[Candidate], terms: Sequence[Term]) -> "Found":
        """Return the result with other sets too, of the same effects the likeliest, and what all were chosen from."""
        solved = {c.keys: c for c in sorted((*self.candidates, *others), key=lambda c: c.log_probability)}
        return with_inclusion(self.problem, best_first(solved), terms)


def search(problem: EquationError, terms: Sequence[Term], rules: SearchRules | None = None,
           present: Sequence[str] = (), known: Sequence[Candidate] = ()) -> Found:
    """Return sets of effects with their probabilities.

    Parameters
    ----------
    problem : EquationError
    terms : sequence of Term
    rules : SearchRules, optional
    present : sequence of str
        Names of effects that are in every set.
    known : sequence of Candidate
        Sets that are solved already.
    """
    rules = rules or SearchRules()
    fixed = chosen_present(problem, terms, present)
    solved = {c.keys: c for c in sorted(known, key=lambda c: c.log_probability)}
    if not known:
        first = first_set(problem, fixed, rules, present)
        solved[first.keys] = first
    same = twins(terms)
    tried = {frozenset(c.terms) for c in [*known, *solved.values()]}
    extended: set[frozenset[Term]] = set()
    exchanged: set[frozenset[Term]] = set()
    while True:
        ranked = best_first(solved)
        least = ranked[0].log_probability - rules.reach
        parents = [c for c in ranked[: rules.beam]
                   if frozenset(c.terms) not in extended and c.log_probability >= least]
        if not parents and frozenset(ranked[0].terms) in exchanged:
            break
        for parent in parents or ranked[:1]:
            (extended if parents else exchanged).add(frozenset(parent.terms))
            next_to = proposals if parents else exchanges
            # The same effects with other shapes are another set: of each effects the best is kept. Beside the best set
            # those that were met before are solved anew: at its sizes they may be more likely.
            wanted = [t for t in next_to(problem, parent, terms, rules, fixed)
                      if not (parents and frozenset(t) in tried)
                      and not any(pair <= {term.kind for term in t} for pair in same)]
            tried |= {frozenset(t) for t in wanted}
            rough = [solve_set(problem, t, parent.posterior.sizes, rules, present, learned=False, near=parent)
                     for t in wanted]
            if not (parents or one_less(parent, fixed)):  # a strong effect tells at once
                rough = [c for c in rough if c.log_probability > parent.log_probability]
            top = max((c.log_probability for c in rough), default=0.0) - rules.slack
            for c in rough:
                new = own_sizes(problem, c, rules, present) if c.log_probability >= top else c
                solved[c.keys] = max(new, solved.get(c.keys, new), key=lambda c: c.log_probability)
    while waiting := [c for c in best_first(solved) if not c.learned
                      and c.log_probability >= best_first(solved)[0].log_probability - rules.slack]:
        solved[waiting[0].keys] = own_sizes(problem, waiting[0], rules, present)
    return with_inclusion(problem, best_first(solved), terms)


def with_inclusion(problem: EquationError, ranked: Sequence[Candidate], terms: Sequence[Term]) -> Found:
    """Return sets of some terms with the probability of each effect, the sum over the sets that hold it."""
    inclusion: dict[Key, float] = {}
    for candidate, p in zip(ranked, Found(problem, tuple(ranked)).probabilities()):
        for key in candidate.keys:
            inclusion[key] = inclusion.get(key, 0.0) + float(p)
    return Found(problem, tuple(ranked), inclusion, tuple(terms))


def first_set(problem: EquationError, terms: Sequence[Term], rules: SearchRules,
              present: Sequence[str] = ()) -> Candidate:
    """Return a set solved from two starts of the sizes.

    Where little may be left unexplained, the numbers may run to where the body has no impedance, and stay there.
    """
    start = start_sizes(problem)
    starts = (start, replace(start, share=start.share + 1.0))
    return max((solve_set(problem, terms, s, rules, present) for s in starts), key=lambda c: c.log_probability)


def best_first(solved: Mapping[Keys, Candidate]) -> list[Candidate]:
    """Return the sets by their probability."""
    return sorted(solved.values(), key=lambda c: -c.log_probability)


def own_sizes(problem: EquationError, candidate: Candidate, rules: SearchRules, present: Sequence[str]) -> Candidate:
    """Return a set with all sizes learned for it, from those that it was solved at, and from stated tolerances."""
    sizes = candidate.posterior.sizes
    starts = [sizes, *([replace(sizes, tolerance=0.0)] if sizes.tolerance > 0.0 else [])]
    return max((solve_set(problem, candidate.terms, s, rules, present, near=candidate) for s in starts),
               key=lambda c: c.log_probability)


def proposals(problem: EquationError, parent: Candidate, terms: Sequence[Term], rules: SearchRules,
              fixed: Sequence[Term]) -> list[tuple[Term, ...]]:
    """Return the sets next to a candidate: one effect more, the most promising first, or one less."""
    columns, less = problem.with_columns(term.columns for term in parent.terms), one_less(parent, fixed)
    if sum(t.active.effect.family != "offset" for t in parent.terms) >= rules.most:
        return less
    best = promise(problem, parent, columns, [t for t in terms if t.key not in parent.keys], rules)
    order = sorted(best.values(), key=lambda pair: -pair[0])[: rules.width]
    return less + [(*parent.terms, term) for value, term in order if value - log_prior(term, rules) > rules.least]


def one_less(parent: Candidate, fixed: Sequence[Term]) -> list[tuple[Term, ...]]:
    """Return the sets without one of the effects."""
    kept = {t.key for t in fixed}
    return [tuple(t for t in parent.terms if t.key != out.key) for out in parent.terms if out.key not in kept]


def exchanges(problem: EquationError, parent: Candidate, terms: Sequence[Term], rules: SearchRules,
              fixed: Sequence[Term]) -> list[tuple[Term, ...]]:
    """Return the sets without one effect, and with another in the place of one that it may stand for.

    Two effects that the records cannot tell apart are never both in a set, and without either it is far behind. Beside
    no effect each one stands: the score test looks at small ones, and a strong one may change the impedance.
    """
    found = one_less(parent, fixed)
    if not found:
        columns = problem.with_columns(term.columns for term in parent.terms)
        return [(*parent.terms, term) for _, term in promise(problem, parent, columns, terms, rules).values()]
    for rest in tuple(found):
        (out,) = set(parent.terms) - set(rest)
        columns = problem.with_columns(term.columns for term in rest)
        free = [out, *(t for t in terms if t.key not in parent.keys)]
        best = promise(problem, parent, columns, free, rules)
        least = best.pop(out.key, (np.inf, out))[0] - rules.slack
        order = sorted((pair for pair in best.values() if pair[0] >= least), key=lambda pair: -pair[0])
        found += [(*rest, term) for _, term in order[: rules.beam]]
    return found


def promise(problem: EquationError, parent: Candidate, columns: Columns, free: Sequence[Term],
            rules: SearchRules) -> dict[Key, tuple[float, Term]]:
    """Return, for each effect, the log odds by the score test that it gains beside some columns, and its best shape.

    At the stated tolerances: wide ones already hold what an effect like a nominal number would explain.
    """
    stated = solve(problem.rows, columns, replace(parent.posterior.sizes, tolerance=0.0))
    best: dict[Key, tuple[float, Term]] = {}
    for value, term in zip(gains(problem.rows, columns, stated, [t.columns for t in free]), free):
        odds = float(value) + log_prior(term, rules)
        if np.isfinite(value) and (term.key not in best or odds > best[term.key][0]):
            best[term.key] = odds, term
    return best


def start_sizes(problem: EquationError) -> Sizes:
    """Return the prior medians of all sizes, and of an unknown exciting force what the model makes of the motion."""
    rows = problem.rows
    share = rows.share.copy()
    for group in range(share.size - rows.spectra, share.size):
        mine = rows.group == group
        excess = np.mean((rows.error[mine] ** 2 - rows.noise[mine]) / rows.scale[mine] ** 2)
        share[group] = np.sqrt(max(excess, (0.01 * share[group]) ** 2))
    sensors = max(int(rows.sensor.max()) + 1, problem.model.n)  # a motion that is not measured has none
    return Sizes(np.log(share), np.log(rows.ambient), np.zeros(sensors), 0.0)


def within_medians(problem: EquationError, sizes: Sizes) -> Sizes:
    """Return sizes with noise and unexplained forces of their prior medians at most: more may be an effect's."""
    start, known = start_sizes(problem), np.arange(sizes.share.size) < sizes.share.size - problem.rows.spectra
    share, ambient = (np.where(known, np.minimum(own, at), own) for own, at in (
        (sizes.share, start.share), (sizes.ambient, start.ambient)))
    return replace(sizes, share=share, ambient=ambient, noise=np.minimum(sizes.noise, start.noise))


def solve_set(problem: EquationError, terms: Sequence[Term], sizes: Sizes, rules: SearchRules,
              present: Sequence[str] = (), learned: bool = True, near: Candidate | None = None) -> Candidate:
    """Return a set of effects with all sizes learned, or with `sizes` as they are, from the unknowns of one `near`.

    Each force is as strong as is likelier of what is found.
    """
    found = solve_terms(problem, terms, sizes, rules, present, learned, near)
    likelier = in_likelier_widths(with_strengths(problem, found.terms, found.posterior.mean), found.terms, rules)
    if all(new is old for new, old in zip(likelier, terms)):
        return found
    return solve_terms(problem, likelier, found.posterior.sizes, rules, present, learned, found)


def solve_terms(problem: EquationError, terms: Sequence[Term], sizes: Sizes, rules: SearchRules,
                present: Sequence[str], learned: bool, near: Candidate | None) -> Candidate:
    """Return a set of effects with their priors as wide as they are."""
    columns = problem.with_columns(term.columns for term in terms)
    none = np.zeros(0)  # a search keeps many sets: what has the length of all rows is left out
    posterior = replace(learn(problem.rows, columns, sizes, rules.sizes, nuisances=problem.base.count,
                              near=None if near is None else carried_over(problem, near, terms, columns),
                              **({} if learned else {"steps": 0})),
                        variance=none, noise=none, residual=none)
    prior = sum(log_prior(term, rules, present) for term in with_strengths(problem, terms, posterior.mean))
    return Candidate(tuple(terms), posterior, float(posterior.log_evidence + prior), learned)


def with_strengths(problem: EquationError, terms: Sequence[Term], unknowns: FloatArray) -> list[Term]:
    """Return the terms with the strengths that are found, those that have one for all records."""
    found = []
    for term, at in placed(problem, terms):
        names = [] if term.active.effect.per_record else term.strengths
        values = {**term.active.values, **dict(zip(names, unknowns[at].tolist()))}
        found.append(replace(term, active=replace(term.active, values=values)))
    return found


def chosen_present(problem: EquationError, terms: Sequence[Term], present: Sequence[str]) -> tuple[Term, ...]:
    """Return, of each effect that is said to be present, the most promising place and shape."""
    if not present:
        return ()
    rows, base = problem.rows, problem.base
    null = learn(rows, base, start_sizes(problem), nuisances=base.count)
    chosen = []
    for name in present:
        mine = [t for t in terms if t.active.name == name]
        if not mine:
            raise InputError(f"present: effect {name!r} cannot be seen in these records, or is not considered")
        chosen.append(mine[int(np.argmax(gains(rows, base, null, [t.columns for t in mine])))])
    return tuple(chosen)


def information(problem: EquationError, null: Posterior, terms: Sequence[Term]) -> FloatArray:
    """Return the information on each term's best seen strength, in units of its prior."""
    found = np.zeros(len(terms))
    for score in scores(problem.rows, problem.base, null, [t.columns for t in terms]):
        found[list(score.at)] = np.diagonal(score.information, axis1=1, axis2=2).max(axis=1, initial=0.0)
    return found


def testable(problem: EquationError, null: Posterior, terms: Sequence[Term],
             least: float) -> tuple[list[Term], list[Key]]:
    """Return the terms that the records can show, and the effects that they cannot.

    Parameters
    ----------
    problem : EquationError
    null : Posterior
        Without effects.
    terms : sequence of Term
    least : float
        Information below which a term cannot be seen: 1 halves the prior's variance.
    """
    known = information(problem, null, terms)
    kept = [t for t, value in zip(terms, known) if value >= least]
    seen = {t.key for t in kept}
    return kept, sorted({t.key for t in terms} - seen)
