"""What records can tell apart, before any fit: the Fisher information of every effect beside the nominal numbers."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import FloatArray, listed, positive
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.design.information import Information, information
from radiation_ss.effects import Active, Effect, effect_named, library
from radiation_ss.effects.nominal import tolerances
from radiation_ss.errors import InputError
from radiation_ss.inference.candidates import terms_of
from radiation_ss.inference.equation import equation_error
from radiation_ss.inference.linear_model import variance
from radiation_ss.inference.motion import measured_motion
from radiation_ss.inference.regression import learn
from radiation_ss.inference.search import start_sizes
from radiation_ss.methods import Brief, accepting
from radiation_ss.records.convert import as_records
from radiation_ss.records.record import Record

# Standard deviations. 5 are 12 nats: enough to pay for a prior ten times as wide as the posterior and for the choice
# among dozens of candidates.
SHOWN = 5.0
TWINS = {
    frozenset({"constant_force", "sensor_bias"}):
        "a steady load shifts the mean by force / stiffness, a bias by itself; only a second displacement sensor, or "
        "reading the sensor with the body held at a known place, tells them apart",
    frozenset({"excitation_gain", "sensor_gain"}):
        "in a linear body twice the force and twice the reading are one, and a decay shows neither; an accelerometer "
        "or a second displacement sensor tells them apart",
    frozenset({"excitation_delay", "sensor_delay"}):
        "one late chain of force, body and sensor: an accelerometer, which reads by a chain of its own, tells where",
    frozenset({"common_excitation_delay", "common_sensor_delay"}):
        "one late chain of waves, body and sensors: an accelerometer, which reads by a chain of its own, tells where",
    frozenset({"linear_damping", "radiation_damping"}):
        "both take energy in proportion to velocity; only damping at several frequencies tells them apart",
    frozenset({"slow_drift", "sensor_bias"}): "a slow load that hardly changes in one record is a steady shift",
    frozenset({"slow_drift", "constant_force"}): "a slow load that hardly changes in one record is a steady one",
}


@dataclass(frozen=True)
class Unseen:
    """An effect that no test of the menu shows, and why."""

    effect: str
    why: str


@dataclass(frozen=True)
class Confound:
    """A pair that no set of the menu's tests tells apart."""

    pair: tuple[str, str]  # First the one of which less is left
    left: float  # Standard deviations that are left of the first beside the second
    exact: bool  # Whether the one makes the other's motion in every test, but for a thousandth
    why: str


def unseen(information: Information, whole: Sequence[int]) -> Iterator[Unseen]:
    """Yield what the whole menu does not show."""
    rows = zip(information.labels, information.detectability(whole), information.detectability(whole, exact=True))
    for label, value, alone in rows:
        if value < SHOWN:
            yield Unseen(label, f"retuning the model within its tolerances makes the same motion: {value:.1f} standard "
                         f"deviations, {alone:.0f} if the model's own numbers were exact" if alone >= SHOWN
                         else f"below the noise: {value:.1f} standard deviations")


def absent(forced: bool, dofs: Sequence[str], effects: Sequence[Effect],
           information: Information) -> tuple[Unseen, ...]:
    """Return the effects that have no place in any test of the menu."""
    there = {term.active.name for term in information.terms}
    no_force = "no test of the menu has a known wave excitation force"
    no_waves = "no test of the menu has a wave elevation"
    other = "it makes no force in these tests"
    return tuple(Unseen(e.name, no_force if e.needs == "force" and not forced else
                        f"it acts on {', '.join(e.modes)} only" if e.modes and not e.places(dofs) else
                        no_waves if e.needs == "waves" else other)
                 for e in effects if e.name not in there and (not e.coupled or len(dofs) > 1))


def confounds(information: Information, whole: Sequence[int], same: float = 1e-3) -> tuple[Confound, ...]:
    """Return the pairs that the menu shows but does not tell apart, exactly if less than a share `same` is left."""
    size, left, terms = information.detectability(whole), information.separation(whole), information.terms
    found = []
    for i in range(size.size):
        for j in range(i):
            first, second = (i, j) if left[i, j] <= left[j, i] else (j, i)
            if min(size[i], size[j]) < SHOWN or left[first, second] >= SHOWN:
                continue
            exact = bool(left[first, second] < same * size[first])
            known = TWINS.get(frozenset({terms[i].active.name, terms[j].active.name}), "")
            much = ("exactly the same motion in every test of the menu" if exact else
                    f"almost the same motion: of {size[first]:.1f} standard deviations {left[first, second]:.1f} "
                    "are left")
            found.append(Confound((information.labels[first], information.labels[second]),
                                  float(left[first, second]), exact, f"{much}; {known}" if known else much))
    return tuple(sorted(found, key=lambda c: c.left))


def counts(information: Information, chosen: Sequence[int]) -> tuple[int, int, float]:
    """Return effects seen, pairs told apart, and the same without a threshold: what makes greedy steps go on."""
    size, left = information.detectability(chosen), information.separation(chosen)
    pairs = np.minimum(left, left.T)[np.triu_indices(size.size, 1)]
    smooth = np.minimum(size / SHOWN, 1.0).sum() + np.minimum(pairs / SHOWN, 1.0).sum()
    return int((size >= SHOWN).sum()), int((pairs >= SHOWN).sum()), float(smooth)


@dataclass(frozen=True, eq=False, repr=False)
class Isolability(Brief):
    """By how much each effect shows, alone and beside each other."""

    labels: tuple[str, ...]  # Effects with their places
    # (k,): By how many standard deviations an effect of its prior's typical size stands out of noise and tolerance
    detectability: FloatArray
    separation: FloatArray  # (k, k): What is left of row i's detectability when effect j may act too, at any size
    next_record: str  # What to measure to split what these records cannot
    least: float = 3.0  # Standard deviations from which on an effect counts as testable and a pair as told apart
    # Share of an effect below which what another leaves of it is the error of the discretised equation of motion
    accuracy: float = 0.01

    @property
    def not_testable(self) -> tuple[str, ...]:
        """Effects that these records cannot show."""
        return tuple(name for name, d in zip(self.labels, self.detectability) if d < self.least)

    @property
    def indistinguishable(self) -> tuple[tuple[str, str], ...]:
        """Pairs of effects that show, but not one beside the other."""
        k = len(self.labels)
        seen = self.detectability >= self.least
        alike = self.separation < np.maximum(self.least, self.accuracy * self.detectability[:, None])
        return tuple((self.labels[i], self.labels[j]) for i in range(k) for j in range(i) if seen[i] and seen[j]
                     and (alike[i, j] or alike[j, i]))

    def __str__(self) -> str:
        rows = [f"{name:44s} {value:9.1f}" for name, value in zip(self.labels, self.detectability)]
        pairs = [f"  {a}  /  {b}" for a, b in self.indistinguishable]
        return "\n".join(["effect, standard deviations at its typical size", *rows, "cannot be told apart:",
                          *(pairs or ["  none"]), f"to measure next: {self.next_record}"])


@accepting(model=as_model, records=as_records)
def isolability(model: Model, records: Sequence[Record] | Record,
                effects: Sequence[str | Effect] | str | Effect | None = None,
                tolerance: float | Mapping[str, float] | None = None, *, noise: float | None = None) -> Isolability:
    """Say what records can tell apart, and what to measure next. Without any record: `plan_tests`.

    Where no force is known its spectrum is unknown, too, and absorbs every linear cause: nonlinear effects and sensors
    against each other remain. Clipped samples, spikes and what comes before the release of a decay are left out.

    Parameters
    ----------
    model : Model, control.StateSpace or path
    records : Record, path or pandas.DataFrame, or a sequence of them
        With known force, zero force or wave elevation; or of motion only. Simulated ones serve as well.
    effects : sequence of str or Effect, or one of them, optional
        All of the library by default.
    tolerance : float or mapping, optional
        As in `diagnose`.
    noise : float, optional
        Standard deviation of the sensors relative to the rms of the motion; estimated from the records if absent.

    Raises
    ------
    InputError
        If there is no record or effect, or one of motion only lacks the displacement of a degree of freedom.

    Examples
    --------
    >>> import numpy as np, radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.02)
    >>> time = np.arange(0.0, 20.0, 0.05)
    >>> motion = rss.simulate(model, (time, np.zeros((1, 400))), start=[0.1, 0.0]).outputs
    >>> decay = rss.Record(time, {"Heave": motion[0]}, kind="decay")
    >>> found = rss.isolability(model, [decay], ["quadratic_drag", "cubic_stiffness"], noise=0.01)
    >>> print(str(found).splitlines()[-1])
      to measure next: nothing: all that shows can be told apart
    """
    given = [records] if isinstance(records, Record) else list(records)
    if not given:
        raise InputError("records: none given; plan_tests needs none")
    chosen = considered(effects)
    runs = [measured_motion(model, record) for record in given]
    if noise is not None:
        noise = positive(noise, "noise (a share of the motion's rms)")
        runs = [replace(run, noise=np.broadcast_to(noise * np.sqrt(np.mean(run.x**2, axis=1, keepdims=True) / run.kept),
                                                   run.noise.shape)) for run in runs]
    problem = equation_error(model, runs, tolerances(tolerance, model.tolerance))
    sizes = learn(problem.rows, problem.base, start_sizes(problem), nuisances=problem.base.count).sizes
    if noise is not None:  # stated, so not to be learned
        sizes = replace(sizes, noise=np.zeros_like(sizes.noise))
    known = information(problem, terms_of(problem, chosen), sum(variance(problem.rows, sizes)) / problem.rows.power)
    size = known.detectability([0])
    best: dict[tuple[str, str, str], int] = {}
    for k, term in enumerate(known.terms):
        if term.key not in best or size[k] > size[best[term.key]]:
            best[term.key] = k
    order = sorted(best.values(), key=lambda k: -size[k])
    left = known.separation([0])[np.ix_(order, order)]
    # What makes no column: an unknown force takes all that is linear in the motion.
    hidden = [Active(e, dof, {}, other).label for e in chosen if not e.needs for dof, other in e.places(model.dofs)
              if (e.name, dof, other) not in best]
    labels = (*(known.labels[k] for k in order), *hidden)
    found = Isolability(labels, np.r_[size[order], np.zeros(len(hidden))], np.pad(left, (0, len(hidden))), "")
    return replace(found, next_record=advice(found, [known.terms[k].active.name for k in order] + hidden))


def considered(effects: Sequence[str | Effect] | str | Effect | None) -> list[Effect]:
    """Return effects by their names; all of the library for None, InputError for none."""
    named = None if effects is None else listed(effects)
    if named == []:
        raise InputError("effects: an empty list; name at least one, or leave it out for the whole library")
    return [*library().values()] if named is None else [e if isinstance(e, Effect) else effect_named(e) for e in named]


def advice(found: Isolability, names: Sequence[str]) -> str:
    """Return what to measure to tell the closest pair apart."""
    pairs = found.indistinguishable
    if not pairs:
        return "nothing: all that shows can be told apart"
    at = {label: name for label, name in zip(found.labels, names)}
    known = [TWINS[key] for a, b in pairs if (key := frozenset({at[a], at[b]})) in TWINS]
    return known[0] if known else "the same test at another amplitude and another frequency"
