"""Laws of the motion that the residuals of a linear fit ask for, by score tests.

A fit of radiation puts most of a quadratic drag, of a damper, or of a stiffness that changes with displacement, down to
other parameters and the rest down to a random force, so that its residuals look healthy. Score (Lagrange multiplier)
tests ask instead for the one shape that the departure would have, with all other parameters free: -c v, -c v|v|,
-c v/|v| and -c x^3, with x and v as the model's own filter has them, and of the same motion of two bodies -c (v1 - v2).
A recorded force of a wrong size asks for mass, stiffness and radiation of that size, a late one for less damping: what
is missing is c f, and f(t + c) - f(t).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import chi2

from radiation_ss.arrays import FloatArray
from radiation_ss.hydro.data import ROTATIONS, mode
from radiation_ss.identification.motion_likelihood import Law, MotionLikelihood
from radiation_ss.identification.study import Study
from radiation_ss.inference.laplace import Peak, Target
from radiation_ss.records.signals import filled

DAMPING, RELATIVE = "linear damping", "relative damping"  # of a motion, and between the same motion of two bodies
LINEAR = (DAMPING, RELATIVE)
DRAG, FRICTION = "quadratic drag", "dry friction"
GAIN, LATE = FORCE = "force gain", "late force"  # of the recorded force: it is 1 / (1 + c) of the true one, c later
UNITS = {**dict.fromkeys(LINEAR, ("N s/m", "N m s/rad")),
         DRAG: ("N s^2/m^2", "N m s^2/rad^2"), "cubic stiffness": ("N/m^3", "N m/rad^3"),
         FRICTION: ("N", "N m"), GAIN: ("of the recorded force",) * 2, LATE: ("s", "s")}


def laws_of(part: MotionLikelihood, u: FloatArray, v: FloatArray, onset: float = 0.1, ratio: float = 0.1,
            bridge: float = 0.5) -> list[Law]:
    """Return the laws of each degree of freedom along the filtered motion; their force peaks at the force's scale.

    That of damping makes the damping ratio `ratio`. Friction is rounded below the share `onset` of the velocity's rms.
    Gaps of up to `bridge` periods are filled; a motion with longer ones has no laws but those of the recorded force.
    """
    channels, out, velocities = part.channels, list[Law](), dict[str, FloatArray]()
    period = channels.period / channels.dt
    filtered = np.stack([filled(column, int(bridge * period), int(3 * bridge * period))
                         for column in part.filtered(u, v).T], axis=1)
    if not np.isfinite(filtered).all():
        return list(recorded_laws(part, v))
    for j, dof in enumerate(part.model.dofs):
        order = {int(channels.derivative[i]): i for i in np.flatnonzero(channels.dof == j)}
        shapes = dict[str, FloatArray]()
        if 0 in order:
            x = filtered[:, order[0]]
            shapes["cubic stiffness"] = x**3
            velocity = CubicSpline(channels.time, x)(channels.time, 1)
        elif 1 in order:
            velocity = filtered[:, order[1]]
        else:
            continue
        velocities[dof] = velocity
        shapes[DRAG] = velocity * np.abs(velocity)
        shapes[FRICTION] = velocity / np.hypot(velocity, onset * velocity.std())
        for kind, shape in shapes.items():
            coefficient = float(part.force_scale[j]) / float(np.abs(shape).max())
            force = np.zeros_like(part.force)
            force[:, j] = -coefficient * shape
            out.append(Law(f"{kind} [{dof}]", force, coefficient))
    moving = np.array([velocities.get(dof, np.zeros(channels.time.size)) for dof in part.model.dofs]).T
    critical = 2.0 * np.diag(part.model.M + part.model.A_inf) * channels.frequency
    for name in dampers(list(velocities)):
        along = direction(part.model.dofs, taken_apart(name)[1])
        coefficient = ratio * float(critical[along != 0.0].min())
        out.append(Law(name, -coefficient * np.outer(moving @ along, along), coefficient))
    return [*out, *recorded_laws(part, v)]


def followed(study: Study, parts: Sequence[MotionLikelihood], target: Target, phi: FloatArray,
             name: str) -> tuple[list[MotionLikelihood], FloatArray]:
    """Return the parts with the law along the filtered motion at phi, added or made anew, and where it starts."""
    u, moved = phi[:study.n_u], []
    for part, at in zip(parts, target.places[-len(parts):]):
        v = phi[at]
        law = next((item for item in laws_of(part, u, v) if item.name == name), None)
        have = next((k for k, item in enumerate(part.laws) if item.name == name), None)
        if law is None:
            moved.append((part, v))
        elif have is None:
            ((score, information, _),) = part.scores_of([law], u, v)
            moved.append(part.with_law(law, v, score / (information + 1.0)))
        else:
            unit = part.laws[have].unit
            law = Law(name, law.force * (unit / law.unit), unit)
            moved.append((replace(part, laws=(*part.laws[:have], law, *part.laws[have + 1:])), v))
    return [part for part, _ in moved], np.concatenate([u, *(v for _, v in moved)])


def recorded_laws(part: MotionLikelihood, v: FloatArray) -> Iterator[Law]:
    """Yield the gain of each recorded force, and the delay of all of them, exact at the delay that is in v."""
    pushed = np.flatnonzero(part.force.any(axis=0))
    if part.wave is not None or pushed.size == 0:
        return
    name = f"{LATE} [{','.join(part.model.dofs[j] for j in pushed)}]"
    delay = next((law.unit * at for law, at in zip(part.laws, v[part.first_law:]) if law.name == name), 0.0)
    time, curve = part.channels.time, CubicSpline(part.channels.time, part.force)
    force = curve(np.clip(time + delay, *time[[0, -1]]))
    missing = (force - part.force) / delay if abs(delay) > 1e-3 * part.channels.dt else curve(time, 1)
    largest = np.maximum(np.abs(missing).max(axis=0), 1e-300)
    coefficient = float(np.min((part.force_scale / largest)[pushed]))
    yield Law(name, coefficient * missing, coefficient)
    for j in pushed:
        coefficient = float(part.force_scale[j]) / float(np.abs(part.force[:, j]).max())
        own = np.arange(part.model.n) == j
        yield Law(f"{GAIN} [{part.model.dofs[j]}]", coefficient * force * own, coefficient)


def dampers(dofs: Sequence[str]) -> list[str]:
    """Return the names of what may damp some motions linearly, and the same motions of two bodies."""
    pairs = [pair for pair in combinations(dofs, 2) if mode(pair[0]) == mode(pair[1])]
    return [*(f"{DAMPING} [{dof}]" for dof in dofs), *(f"{RELATIVE} [{a},{b}]" for a, b in pairs)]


def direction(dofs: Sequence[str], where: str) -> FloatArray:
    """Return g (n,) of a damper whose force is -c g (g . v), at a degree of freedom or between two."""
    one, _, other = where.partition(",")
    return np.array([(dof == one) - float(dof == other) for dof in dofs])


def taken_apart(name: str) -> tuple[str, str]:
    """Return kind and degree of freedom of a law's name."""
    kind, dof = name.removesuffix("]").split(" [")
    return kind, dof


def score_laws(target: Target, peak: Peak, parts: Sequence[MotionLikelihood]) -> dict[str, dict[str, float]]:
    """Return, for each law, the one-step estimate of its coefficient with standard deviation, statistic and p.

    Coefficients of the laws in SI units, shared by all records that carry displacement or velocity.
    """
    gradient, u = target.local(peak.phi)[1], peak.phi[:target.n_u]
    found: dict[str, list[tuple[float, float, FloatArray]]] = {}
    for part, at in zip(target.likelihoods, target.places):
        if not isinstance(part, MotionLikelihood) or not any(part is own for own in parts):
            continue
        v = peak.phi[at]
        laws = laws_of(part, u, v)
        for law, (score, information, cross) in zip(laws, part.scores_of(laws, u, v)):
            row = np.zeros(peak.phi.size)
            row[np.r_[0:target.n_u, at]] = cross / law.unit
            found.setdefault(law.name, []).append((score / law.unit, information / law.unit**2, row))
    out = {}
    for name, rows in found.items():
        cross = np.sum([row for _, _, row in rows], axis=0)
        projected = np.linalg.solve(peak.fisher, cross)
        left = sum(information for _, information, _ in rows) - float(cross @ projected)
        score = sum(value for value, _, _ in rows) - float(gradient @ projected)
        if left > 0.0:
            out[name] = {"estimate": score / left, "std": left**-0.5, "statistic": score**2 / left,
                         "p": float(chi2.sf(score**2 / left, 1))}
    return out


def least_of(study: Study, name: str) -> float:
    """Return the least coefficient of a law: none gives energy, nor is more linear damping than it states taken from
    the model.
    """
    kind, where = taken_apart(name)
    along = direction(study.model.dofs, where)
    assert study.model.D is not None
    if kind in LINEAR:
        return -float(along @ study.model.D @ along) / float(along @ along) ** 2
    return 0.0 if kind in (DRAG, FRICTION) else -np.inf


def placed(target: Target, parts: Sequence[MotionLikelihood]) -> list[tuple[Law, int]]:
    """Return the laws of the last likelihoods of a target, each with the place of its strength in phi."""
    return [(law, at.start + part.first_law + k) for part, at in zip(parts, target.places[-len(parts):])
            for k, law in enumerate(part.laws)]


def lawful_draws(study: Study, laws: Sequence[tuple[Law, int]], draws: FloatArray, slack: float = 1e-6) -> FloatArray:
    """Return as many draws (nd, d), of them only those that are lawful, but for a share `slack` of a law's unit."""
    inside = np.ones(draws.shape[0], dtype=bool)
    for law, at in laws:
        inside &= law.unit * (draws[:, at] + slack) > least_of(study, law.name)
    kept = draws[inside] if inside.any() else draws
    return kept[np.arange(draws.shape[0]) % kept.shape[0]]


def strength(name: str, laws: Sequence[tuple[Law, int]], draws: FloatArray) -> FloatArray:
    """Return a law's coefficient [SI] by all records that have it, the surest counting most, for each draw (nd, d)."""
    own = [(law, at) for law, at in laws if law.name == name]
    found = np.array([law.unit * draws[:, at] for law, at in own])
    weights = 1.0 / np.maximum(found.var(axis=1), 1e-18 * max(law.unit for law, _ in own) ** 2)
    return np.asarray(weights @ found / weights.sum())


def law_warnings(tests: dict[str, dict[str, float]], laws: Sequence[str], done: str) -> Iterator[str]:
    """Yield a warning for each law that the records ask for, with what was done about it."""
    for name in laws:
        kind, dof = taken_apart(name)
        what = ("waves do not carry away all damping" if kind in LINEAR else
                "the recorded force does not fit the motion" if kind in FORCE else "the body does not look linear")
        yield (f"{what}: the records ask for {name} of {tests[name]['estimate']:.3g} +- "
               f"{tests[name]['std']:.2g} {UNITS[kind][mode(dof) in ROTATIONS]} (p = {tests[name]['p']:.2g}); {done}: "
               "run diagnose")
