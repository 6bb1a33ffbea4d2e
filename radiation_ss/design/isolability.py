"""What records can tell apart, before any fit: the Fisher information of every effect beside the nominal numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.design.motion_isolability import motion_map
from radiation_ss.effects import Effect, effect_named, library
from radiation_ss.effects.nominal import tolerances
from radiation_ss.errors import InputError
from radiation_ss.gap.answer.words import advice
from radiation_ss.gap.motion.diagnose import SHOWS
from radiation_ss.gap.posterior.fitting import fit
from radiation_ss.gap.posterior.given import check_some, force_known
from radiation_ss.gap.posterior.noise import white
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import setting_of, terms_of
from radiation_ss.gap.tolerance.null_fit import floors_of
from radiation_ss.gap.which.score import Score, scores
from radiation_ss.records.record import Record
from radiation_ss.simulation.measured import measured_freely

DETECTABLE = SEPARABLE = 3.0  # standard deviations


@dataclass(frozen=True, eq=False)
class Isolability:
    """By how much each effect shows, alone and beside each other.

    Parameters
    ----------
    labels : tuple of str
        Effects with their places.
    detectability : ndarray, shape (k,)
        By how many standard deviations an effect of its prior's typical size stands out of noise and tolerance.
    separation : ndarray, shape (k, k)
        What is left of row i's detectability when effect j may act too, at any size.
    next_record : str
        What to measure to split what these records cannot.
    least : float
        Standard deviations from which on an effect counts as testable and a pair as told apart.
    """

    labels: tuple[str, ...]
    detectability: FloatArray
    separation: FloatArray
    next_record: str
    least: float = DETECTABLE

    @property
    def not_testable(self) -> tuple[str, ...]:
        """Effects that these records cannot show."""
        return tuple(name for name, d in zip(self.labels, self.detectability) if d < self.least)

    @property
    def indistinguishable(self) -> tuple[tuple[str, str], ...]:
        """Pairs of effects that show, but not one beside the other."""
        k = len(self.labels)
        seen = self.detectability >= self.least
        return tuple((self.labels[i], self.labels[j]) for i in range(k) for j in range(i) if seen[i] and seen[j]
                     and min(self.separation[i, j], self.separation[j, i]) < self.least)

    def __str__(self) -> str:
        rows = [f"{name:44s} {value:9.1f}" for name, value in zip(self.labels, self.detectability)]
        pairs = [f"  {a}  /  {b}" for a, b in self.indistinguishable]
        return "\n".join(["effect, standard deviations at its typical size", *rows, "cannot be told apart:",
                          *(pairs or ["  none"]), f"to measure next: {self.next_record}"])


def isolability(model: Model, records: Sequence[Record] | Record, effects: Sequence[str | Effect] | None = None,
                tolerance: float | Mapping[str, float] = 0.02, *, noise: float | None = None) -> Isolability:
    """Say what records can tell apart, and what to measure next. Without any record: `plan_tests`.

    Where no force is known the unknown force absorbs every linear cause: nonlinear effects and sensors against each
    other remain (Whittle's information), the rest has detectability 0. Records of known force come first: beside
    them, motion-only records are left out, as `diagnose` does; and so are clipped samples, spikes and what comes before
    the release of a decay.

    Parameters
    ----------
    model : Model
    records : sequence of Record
        With known force, zero force or wave elevation; or of motion only. Simulated ones serve as well.
    effects : sequence of str or Effect, optional
        All of the library by default.
    tolerance : float or mapping
        As in `diagnose`.
    noise : float, optional
        Standard deviation of the sensors relative to the rms of the motion; estimated from the records if absent.
        Of motion-only records it is always what they hold.

    Returns
    -------
    Isolability

    Raises
    ------
    InputError
        If there is no record or effect, or one of motion only lacks the displacement of a degree of freedom.
    """
    given = [records] if isinstance(records, Record) else list(records)
    if not given:
        raise InputError("records: none given; plan_tests needs none")
    check_some(effects)
    given = [measured_freely(model, record)[0] for record in given]
    spread = tolerances(tolerance)
    chosen = [e if isinstance(e, Effect) else effect_named(e) for e in effects] if effects is not None else None
    known = [record for record in given if force_known(model, record)]
    if not known:
        labels, size, left = motion_map(model, given, list(library().values()) if chosen is None else chosen)
        return Isolability(labels, size, left, "waves with the exciting force known, or a decay test: motion alone "
                           "tests no linear cause", SHOWS)
    setting = setting_of(model, known, spread)
    problem = Problem(setting)
    channels = [c for item in setting.records for c in item.channels]
    start = fit(problem, white([0.01 * max(float(np.std(c.value)), 1e-300) for c in channels]), np.zeros(problem.size),
                tolerance=0.1)
    floors = floors_of(setting, start) if noise is None else tuple(
        noise * max(float(np.std(c.value)), 1e-300) for c in channels)
    return separate(scores(fit(problem, white(floors), start.q, tolerance=0.1), terms_of(setting, chosen)))


def separate(found: Sequence[Score]) -> Isolability:
    """Return the map from the scores' projected derivatives; of the starts of a shape the best seen one counts."""
    best: dict[tuple[str, str, str], tuple[float, Score]] = {}
    for item in found:
        value = float(np.sqrt(max(np.linalg.eigvalsh(item.information)[-1], 0.0)))
        if item.term.key not in best or value > best[item.term.key][0]:
            best[item.term.key] = (value, item)
    kept = sorted(best.values(), key=lambda entry: -entry[0])
    items = [item for _, item in kept]
    k = len(items)
    size = np.array([value for value, _ in kept])
    separation = np.tile(size[:, None], (1, k))
    for i in range(k):
        for j in range(k):
            if i != j:
                separation[i, j] = size[i] * left_beside(items[i], items[j])
    labels = tuple(item.term.active.label for item in items)
    close = [(i, j) for i in range(k) for j in range(i) if size[i] >= DETECTABLE and size[j] >= DETECTABLE
             and min(separation[i, j], separation[j, i]) < SEPARABLE]
    worst = min(close, key=lambda pair: separation[pair], default=None)
    families = frozenset(items[i].term.active.effect.family for i in worst) if worst else frozenset[str]()
    advised = advice(families) if worst else "nothing: all that shows can be told apart"
    return Isolability(labels, size, separation, advised)


def left_beside(one: Score, other: Score) -> float:
    """Return the share of the first effect's strongest direction that the second cannot imitate."""
    values, vectors = np.linalg.eigh(one.information)
    direction = one.columns @ vectors[:, -1]
    if values[-1] <= 0.0:
        return 0.0
    fitted = other.columns @ np.linalg.lstsq(other.columns, direction, rcond=None)[0]
    return float(np.linalg.norm(direction - fitted) / np.linalg.norm(direction))
