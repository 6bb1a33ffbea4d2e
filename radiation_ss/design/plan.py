"""Which tests to do: a model, no record yet, and the set of tests that shows most and tells most apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss.arrays import FloatArray, listed, positive
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.design.information import Information, information_of
from radiation_ss.design.isolability import SHOWN, Confound, Unseen, absent, confounds, considered, counts, unseen
from radiation_ss.design.programme import PlannedTest, amplitudes, standard_tests
from radiation_ss.effects import Effect
from radiation_ss.effects.nominal import tolerances
from radiation_ss.errors import InputError
from radiation_ss.methods import Shown, accepting, later
from radiation_ss.records.convert import as_one_record
from radiation_ss.records.record import Record

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def rank(information: Information, chosen: Sequence[int]) -> tuple[int, float]:
    """Return what sets are compared by; small differences leave the choice to the menu's order, simple tests first."""
    seen, apart, smooth = counts(information, chosen)
    return seen + apart, round(smooth, 1)


def needed(information: Information, menu: Sequence[PlannedTest], whole: Sequence[int]) -> list[int]:
    """Return tests that do what the whole menu does; none can be left out, or replaced by one earlier on the menu."""
    goal, chosen = rank(information, whole)[0], list[int]()
    while not chosen or (rank(information, chosen)[0] < goal and len(chosen) < len(whole)):
        # The same run with other sensors is not done twice.
        chosen = max(([*(other for other in chosen if menu[other].record is not menu[k].record), k]
                      for k in range(len(menu)) if k not in chosen), key=lambda some: rank(information, some))
    goal = rank(information, chosen)[0]
    for k in list(chosen):
        rest = [other for other in chosen if other != k]
        taken = [id(menu[other].record) for other in rest]
        simpler = [[*rest, other] for other in range(k) if id(menu[other].record) not in taken]
        for some in ([rest] if rest else []) + simpler:
            if rank(information, some)[0] >= goal:
                chosen = some
                break
    return chosen


@dataclass(frozen=True)
class Step:
    """One test of the plan."""

    test: str
    # seen, apart: Effects seen and pairs told apart after it
    seen: int
    apart: int
    adds: tuple[str, ...]  # Effects seen for the first time


@dataclass(frozen=True, eq=False, repr=False)
class TestPlan(Shown):
    """The tests to do, most telling first, and the map of what each shows.

    Parameters
    ----------
    name : str
        The model's.
    tests : tuple of PlannedTest
        The menu.
    labels : tuple of str
        Effects with their places, best seen first.
    steps : tuple of Step
        The tests to do, the most telling first.
    single : ndarray, shape (nt, k)
        By how many standard deviations each effect stands out in each test alone.
    detectability : ndarray, shape (k,)
        The same in the plan's tests together.
    separation : ndarray, shape (k, k)
        What the plan's tests leave of row i's detectability when effect j may act too, at any size.
    alone : tuple of (int, int)
        Effects seen and pairs told apart by each test alone.
    reachable : tuple of int
        Effects seen and pairs told apart by the whole menu.
    unseen : tuple of Unseen
        Effects that no test of the menu shows, and why.
    confounded : tuple of Confound
        Pairs that stay inseparable by the whole menu, and why.
    information : Information

    Examples
    --------
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.05)
    >>> plan = rss.plan_tests(model, 0.1, ["quadratic_drag", "cubic_stiffness"], tests=["decay"])
    >>> sorted(plan.labels), plan.reachable
    (['cubic_stiffness on Heave', 'quadratic_drag on Heave'], (2, 1))
    """

    __test__ = False  # not a test case of pytest

    name: str
    tests: tuple[PlannedTest, ...]
    labels: tuple[str, ...]
    steps: tuple[Step, ...]
    single: FloatArray
    detectability: FloatArray
    separation: FloatArray
    alone: tuple[tuple[int, int], ...]
    reachable: tuple[int, int]
    unseen: tuple[Unseen, ...]
    confounded: tuple[Confound, ...]
    information: Information

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the tests to do."""
        return tuple(step.test for step in self.steps)

    @property
    def records(self) -> tuple[Record, ...]:
        """What the chosen tests would measure, without noise, if the model were right."""
        by_name = {test.name: test for test in self.tests}
        return tuple(by_name[name].measured for name in self.chosen)

    def together(self, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Return detectability (k,) and separation (k, k) of any set of the menu's tests.

        Raises
        ------
        InputError
            If a name is not on the menu.

        >>> shown, apart = plan.together([plan.tests[0].name])
        >>> shown.shape, apart.shape
        ((2,), (2, 2))
        """
        known = {test.name: k for k, test in enumerate(self.tests)}
        if missing := [name for name in names if name not in known]:
            raise InputError(f"test {missing[0]!r} is not on the menu, which has {', '.join(known)}")
        chosen = [known[name] for name in names]
        return self.information.detectability(chosen), self.information.separation(chosen)

    def __str__(self) -> str:
        return later("report.plan_plot:text", self)

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as JSON holds it.

        >>> sorted(plan.to_dict())[:2]
        ['alone', 'confounded']
        """
        return {"schema": "radiation_ss.plan/1", "model": self.name, "effects": list(self.labels),
                "tests": {t.name: t.description for t in self.tests},
                "plan": [{"test": s.test, "seen": s.seen, "apart": s.apart, "adds": list(s.adds)} for s in self.steps],
                "single": {t.name: row.tolist() for t, row in zip(self.tests, self.single)},
                "detectability": self.detectability.tolist(), "separation": self.separation.tolist(),
                "alone": {t.name: {"seen": s, "apart": a} for t, (s, a) in zip(self.tests, self.alone)},
                "reachable": {"seen": self.reachable[0], "apart": self.reachable[1]},
                "unseen": {u.effect: u.why for u in self.unseen},
                "confounded": [{"pair": list(c.pair), "left": c.left, "why": c.why} for c in self.confounded]}

    def plot(self) -> "Figure":
        """Draw what each test shows and what the plan tells apart.

        >>> len(plan.plot().axes)
        3
        """
        return later("report.plan_plot:plot_plan", self)

    def save(self, folder: str | Path) -> None:
        """Write plan.json and plan.png.

        >>> import os
        >>> plan.save("plan")
        >>> sorted(os.listdir("plan"))
        ['plan.json', 'plan.png']
        """
        later("report.plan_plot:save", self, folder)


@accepting(model=as_model)
def plan_tests(model: Model, amplitude: float | Mapping[str, float] | None = None,
               effects: Sequence[str | Effect] | str | Effect | None = None,
               tolerance: float | Mapping[str, float] | None = None, *,
               noise: float = 0.01, sea: tuple[float, float] | None = None,
               gap: float | None = 0.05, tests: Mapping[str, Record] | Sequence[str] | str | None = None) -> TestPlan:
    """Plan tests from a model alone: no record is needed.

    The model is run through a menu of standard tests. Derivatives by every effect, the model's numbers and the starts
    give each test's Fisher information, and that of tests adds up. The best test is taken first, then the one that
    adds most, until nothing is gained; a test without which nothing is lost is taken out again,
    and simpler tests and sensors, earlier on the menu, take the place of others where they do. An effect counts as
    seen, a pair as told apart, from 5 standard deviations on.

    Parameters
    ----------
    model : Model, control.StateSpace or path
    amplitude : float or mapping of dof to float, optional
        Largest displacement in the tests [m or rad]. Effects, noise and small tests are relative to it, so
        that with one degree of freedom it changes descriptions, not the choice. Without it: alike energy in every
        degree of freedom.
    effects : sequence of str or Effect, or one of them, optional
        Those that matter; all of the library by default.
    tolerance : float or mapping, optional
        How far the model's own numbers may be off, as in `diagnose`.
    noise : float
        Standard deviation of a sensor relative to the rms of what it reads at full amplitude; the same sensor, with the
        same noise, serves at small amplitude.
    sea : (Hs, Tp), optional
        Significant height [m] and peak period [s] of the waves; needs X in the model.
    gap : float or None
        Size of the effects that matter: each is as large as changes the motion by this share in the full-amplitude
        test that it changes most. None: the sizes typical in the library (most 0.12 of the model's own force).
    tests : mapping of name to Record, str or sequence of str, optional
        Tests of one's own in place of the menu: records with known force (or decays), as `simulate` predicts them. Or
        what names of the menu begin with: ("decay", "waves with force").

    Raises
    ------
    InputError
        If an amplitude, the noise or the sea is not positive, or a test's force is unknown.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.05)
    >>> plan = rss.plan_tests(model, 0.1, ["quadratic_drag", "cubic_stiffness"], tests=["decay"])
    >>> print(str(plan).splitlines()[0])
    Tests for body: the whole menu shows 2 of 2 effects and tells 1 of 1 pairs apart.
    """
    full = list[PlannedTest]()  # at full amplitude, for the sizes of a menu that has none
    for name, value in (("noise", noise), ("gap", 1.0 if gap is None else gap)):
        positive(value, f"{name} (a share of the motion: 0.01 is 1 %)")
    if isinstance(tests, Mapping):
        menu = [PlannedTest(name, "given", as_one_record(record, model)) for name, record in tests.items()]
    else:
        if tests is not None and not all(isinstance(name, str) for name in listed(tests)):
            raise InputError("tests: beginnings of names of the menu are needed, or a mapping of names to records")
        every = standard_tests(model, amplitudes(model, amplitude), sea, told=amplitude is not None)
        menu = [t for t in every if tests is None or t.name.startswith(tuple(listed(tests)))]
        full = [] if any(t.large for t in menu) else [t for t in every if t.large]
    if not menu:
        swings = bool(np.any(np.diag(model.C) > 0.0))
        none = "" if swings else f"; there is no decay, as nothing oscillates: C restores no {' or '.join(model.dofs)}"
        raise InputError(f"tests: none of the menu is left; its names begin with {'decay, ' * swings}forced sweep, "
                         f"waves with force, waves with elevation (where the model carries X){none}")
    spread = tolerances(tolerance, model.tolerance)
    # What the fit of the memory leaves out counts as tolerance, as in `diagnose`.
    spread["kernel"] = float(np.hypot(spread["kernel"], np.nan_to_num(model.fit.relative_error)))
    chosen = considered(effects)
    records = [test.record for test in menu]
    forced = any(record.get("force", model.dofs) is not None and record.kind != "decay" for record in records)
    lacking = {"force": not forced, "waves": not any("wave_elevation" in record.channels for record in records)}
    act = [effect for effect in chosen if not lacking.get(effect.needs, False)]
    found = information_of(model, [*menu, *full], act, spread, noise, gap)
    found = replace(found, tests=found.tests[:len(menu)])
    if not found.terms:
        raise InputError("effects: none of them can act in these tests")
    return plan_of(model.name, menu, found, absent(forced, model.dofs, chosen, found))


def plan_of(name: str, menu: Sequence[PlannedTest], information: Information,
            hidden: tuple[Unseen, ...] = ()) -> TestPlan:
    """Return the plan: greedy, then without what it does not need."""
    whole = list({id(test.record): k for k, test in enumerate(menu)}.values())  # the best equipped of each
    done = needed(information, menu, whole)
    order = np.argsort(-information.detectability(done), kind="stable").tolist()
    information = replace(information, terms=tuple(information.terms[k] for k in order),
                          places=tuple(information.places[k] for k in order))
    steps, before, chosen = [], np.zeros(len(order), bool), list[int]()
    while len(chosen) < len(done):  # the most telling test next
        chosen = max(([*chosen, k] for k in done if k not in chosen), key=lambda some: rank(information, some))
        seen = information.detectability(chosen) >= SHOWN
        steps.append(Step(menu[chosen[-1]].name, *counts(information, chosen)[:2],
                          tuple(label for label, new in zip(information.labels, seen & ~before) if new)))
        before = seen
    return TestPlan(name, tuple(menu), information.labels, tuple(steps),
                    np.stack([information.detectability([k]) for k in range(len(menu))]),
                    information.detectability(done), information.separation(done),
                    tuple(counts(information, [k])[:2] for k in range(len(menu))),
                    counts(information, whole)[:2], (*unseen(information, whole), *hidden),
                    confounds(information, whole), information)
