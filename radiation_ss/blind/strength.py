"""How strong a hidden cause is made: by the gap that it leaves after retuning every nominal number in tolerance."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from radiation_ss.arrays import FloatArray
from radiation_ss.blind.bodies import Body
from radiation_ss.blind.causes import CAUSES, Hidden, Typical, draw
from radiation_ss.blind.experiments import STEPS_PER_RADIAN, Plan, Run, happen
from radiation_ss.errors import SolverError

TOLERANCE = 0.02
BEYOND, LARGEST = 4.0, 0.5  # a cause like a parameter is off by at least so many tolerances, and by at most this share


def distance(one: Sequence[Run], other: Sequence[Run], tests: Sequence[Plan]) -> float:
    """Return the gap: rms of the difference of two motions over the rms of the first, each dof by its own rms."""
    terms = []
    for i in range(one[0].x.shape[0]):
        kept = [(a.x[i][a.time >= p.cut], b.x[i][b.time >= p.cut]) for a, b, p in zip(one, other, tests)]
        power = sum(float(np.sum(a**2)) for a, _ in kept)
        terms.append(sum(float(np.sum((a - b) ** 2)) for a, b in kept) / power)
    return float(np.sqrt(np.mean(terms)))


def stacked(runs: Sequence[Run], calm: Sequence[Run], tests: Sequence[Plan]) -> FloatArray:
    """Return runs - calm as one vector, each degree of freedom over its rms in calm, weighted to unit mean square."""
    parts = []
    for i in range(calm[0].x.shape[0]):
        kept = [(a.x[i][a.time >= p.cut][::8], b.x[i][b.time >= p.cut][::8]) for a, b, p in zip(runs, calm, tests)]
        size = np.sqrt(sum(float(np.sum(b**2)) for _, b in kept))
        parts += [(a - b) / size for a, b in kept]
    return np.concatenate(parts) / np.sqrt(calm[0].x.shape[0])


def retunings(body: Body, tests: Sequence[Plan], calm: Sequence[Run], spread: float = 0.5) -> FloatArray:
    """Return what one tolerance of each nominal number, and `spread` of each unknown start, change in the motion."""
    n, dt, more = len(body.dofs), float(calm[0].time[1]), 1.0 + TOLERANCE
    at = [1.0 + TOLERANCE * np.diag(row) for row in np.eye(n)]
    bodies = [replace(body, **{name: getattr(body, name) * at[i]}) for i in range(n) for name in ("M", "C")]
    bodies.append(replace(body, modes=tuple(replace(m, R=m.R * more) for m in body.modes)))
    bodies.append(replace(body, modes=tuple(replace(m, c0=m.c0 * more) for m in body.modes)))
    if any(test.height > 0.0 for test in tests):
        bodies.append(replace(body, gain=body.gain * more))
    columns = [stacked([happen(other, test, dt=dt) for test in tests], calm, tests) for other in bodies]
    for k, test in enumerate(tests):
        for i in range(n):
            if test.released[i] != 0.0:
                start = tuple(x * (1.02 if j == i else 1.0) for j, x in enumerate(test.released))
                runs = [*calm[:k], happen(body, replace(test, released=start), dt=dt), *calm[k + 1:]]
                columns.append(stacked(runs, calm, tests) * spread / 0.02)
    return np.stack(columns, axis=1)


def left_after(change: FloatArray, columns: FloatArray, farthest: float = 2.0, noise: float = 0.01) -> float:
    """Return the gap left of a change of motion, with its noise, after retuning by `farthest` tolerances."""
    weight = noise / np.sqrt(change.size)
    rows = np.concatenate([columns / weight, np.eye(columns.shape[1])])
    right = np.concatenate([change / weight, np.zeros(columns.shape[1])])
    triangle = np.asarray(np.linalg.qr(np.column_stack([rows, right]), mode="r"))[:-1]
    best = lsq_linear(triangle[:, :-1], triangle[:, -1], (-farthest, farthest), method="bvls").x
    return float(np.linalg.norm(change - columns @ best))


def typical(runs: Sequence[Run], body: Body, dof: int) -> Typical:
    """Return typical sizes of a degree of freedom in the tests."""

    def rms(rows: Sequence[FloatArray]) -> float:
        return float(np.sqrt(np.mean(np.concatenate(rows) ** 2)))

    return Typical(rms([r.x[dof] for r in runs]), rms([r.v[dof] for r in runs]), rms([r.force[dof] for r in runs]),
                   float((body.M + body.A_inf)[dof, dof]), float(body.C[dof, dof]),
                   float(body.frequencies()[dof] or body.frequencies().max()), runs[0].time[-1],
                   rms([r.x[1 - dof] for r in runs]) if len(body.dofs) == 2 else 0.0)


def at_gap(item: Hidden, target: float, body: Body, tests: Sequence[Plan], calm: Sequence[Run],
           columns: FloatArray) -> tuple[Hidden, float]:
    """Return the cause at the strength that leaves the wanted gap after retuning, and the gap, within a factor 1.5."""
    weak, strong = 0.0, np.inf
    for _ in range(9):
        gap = left(item, body, tests, calm, columns)
        if np.isfinite(gap) and 0.8 < gap / target < 1.25:
            break
        if gap < target:
            weak = item.strength
        else:
            strong = item.strength
        step = float(np.clip(target / gap, 0.2, 5.0)) if np.isfinite(gap) and gap > 0.0 else 2.0
        guess = item.strength * step
        if not weak < guess < strong or (weak > 0.0 and np.isfinite(strong)):
            guess = float(np.sqrt(weak * strong)) if weak > 0.0 else 0.5 * strong
        item = replace(item, strength=guess)
    if not np.isfinite(gap) or not 1 / 1.5 < gap / target < 1.5:
        raise SolverError(f"{item.cause}: no strength gives a gap of {target}")
    return item, gap


def left(item: Hidden, body: Body, tests: Sequence[Plan], calm: Sequence[Run], columns: FloatArray) -> float:
    """Return the gap that a cause leaves after retuning; infinite where the motion grows without bounds."""
    runs = caused(item, body, tests, calm)
    return np.inf if runs is None else left_after(stacked(runs, calm, tests), columns)


def caused(item: Hidden, body: Body, tests: Sequence[Plan], calm: Sequence[Run]) -> list[Run] | None:
    """Return what happens with a cause at work, in the steps of the calm runs; None where it grows without bounds."""
    runs = [happen(body, test, [item], float(calm[0].time[1])) for test in tests]
    return runs if all(np.isfinite(run.x).all() and np.abs(run.x).max() < 1e3 for run in runs) else None


def calm_runs(body: Body, tests: Sequence[Plan]) -> list[Run]:
    """Return what happens without a cause, in steps twice as long: strengths need no fine ones."""
    return [happen(body, test, dt=2.0 / (STEPS_PER_RADIAN * float(body.frequencies().max()))) for test in tests]


def hide(names: Sequence[str], body: Body, tests: Sequence[Plan], target: float, rng: np.random.Generator,
         ) -> tuple[list[Hidden], list[float]]:
    """Return causes at strengths that leave the wanted gap after retuning, each by itself, and those gaps."""
    calm = calm_runs(body, tests)
    columns = retunings(body, tests, calm) if names else np.zeros((1, 1))
    found, gaps = [], []
    for name in names:
        dof = int(rng.integers(len(body.dofs))) * (CAUSES[name].law not in ("clip", "soft_clip"))
        item = draw(name, dof, typical(calm, body, dof), rng)
        relative = within(item, body)
        if relative and rng.random() < 0.5:
            # Half of the causes like a parameter are drawn by size: retuning may leave next to nothing of them.
            item = replace(item, strength=TOLERANCE * rng.uniform(BEYOND, 10.0) / relative)
            gap = left(item, body, tests, calm, columns)
        else:
            item, gap = at_gap(item, target, body, tests, calm, columns)
            if relative and not BEYOND * TOLERANCE < relative * item.strength < LARGEST:
                raise SolverError(f"{name}: a gap of {target} needs {relative * item.strength:.0%}")
        found.append(item)
        gaps.append(gap)
    return found, gaps


def of_size(names: Sequence[str], body: Body, tests: Sequence[Plan], rng: np.random.Generator,
            ) -> tuple[list[Hidden], list[float]]:
    """Return causes on different motions whose force is 7 to 20 % of the restoring one, and the gap that each opens.

    For bodies with so many numbers that retuning all of them takes long.
    """
    calm = calm_runs(body, tests)
    moving = [i for i in range(len(body.dofs)) if body.C[i, i] > 0.0]
    found = [replace(draw(name, int(dof), typical(calm, body, int(dof)), rng), strength=rng.uniform(0.7, 2.0))
             for name, dof in zip(names, rng.permutation(moving))]
    gaps = []
    for item in found:
        runs = caused(item, body, tests, calm)
        gaps.append(np.inf if runs is None else distance(runs, calm, tests))
        if not 0.03 < gaps[-1] < 0.6:
            raise SolverError(f"{item.cause}: a gap of {gaps[-1]:.2g}")
    return found, gaps


def within(item: Hidden, body: Body) -> float:
    """Return the relative size of a parameter-like cause at strength 1; 0 for other causes."""
    d = item.dof
    scale = {"linear_stiffness": body.C[d, d], "added_inertia": body.M[d, d], "radiation_damping": 1.0,
             "excitation_gain": 1.0, "sensor_gain": 1.0, "coupling_inertia": 1.0}.get(item.cause)
    return abs(item.parameters[0]) / float(scale) if scale else 0.0
