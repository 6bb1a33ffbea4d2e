"""What forces do to the corrected body, as the rows of its motion see it."""

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.dynamics import impedance
from radiation_ss.body.model import Model
from radiation_ss.inference.linear_model import Columns, Posterior, variance
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.problem import EquationError
from radiation_ss.inference.rows import Place


def weights_of_motion(problem: EquationError, columns: Columns, posterior: Posterior) -> dict[Place, FloatArray]:
    """Return the inverse standard deviation of each row of the motion: noise, and unexplained force through Z."""
    _, relative_part, steady = variance(problem.rows, posterior.sizes)
    force, found = relative_part + steady, dict[Place, FloatArray]()
    for r, (run, change) in enumerate(zip(problem.runs, changes_of_impedance(problem, columns, posterior))):
        if run.prescribed:
            continue
        soft = compliance(problem.model, run, change)
        for place in problem.places:
            if place.record != r or place.order >= 0:
                continue
            i = place.dof
            noise = np.tile(run.noise[i, : place.bins] ** 2, len(run.basis)) * np.exp(2 * posterior.sizes.noise[i])
            moved_by = force[place.rows].reshape(len(run.basis), -1) @ soft[i, : place.bins, : place.bins].T
            found[place] = np.sqrt(problem.rows.power[place.rows] / (noise + moved_by.ravel()))
    return found


def changes_of_impedance(problem: EquationError, columns: Columns, posterior: Posterior) -> list[ComplexArray]:
    """Return by how much of itself each motion's impedance is less in each record, at its `omega_fine`, (nw, n)."""
    ends = np.cumsum([run.omega_fine.size * problem.model.n for run in problem.runs])
    return [part.reshape(-1, problem.model.n) for part in np.split(columns.relative @ posterior.mean, ends[:-1])]


def stiffened(model: Model, run: MeasuredMotion, at: FloatArray, change: ComplexArray | None) -> ComplexArray:
    """Return the impedance of the corrected body, (nw, n, n), with a rate of decay 1/T more: see `compliance`."""
    T, w = run.time[-1] - run.time[0], at[:, None, None]
    Z = impedance(model, at) + (2j * w + 1.0 / T) / T * (model.M + model.A_inf)
    less = 0.0 if change is None else change * np.einsum("wii->wi", impedance(model, run.omega_fine))
    for i, column in enumerate(np.broadcast_to(less, (run.omega_fine.size, model.n)).T):
        Z[:, i, i] -= np.interp(at, run.omega_fine, column)
    return np.asarray(Z)


def compliance(model: Model, run: MeasuredMotion, change: ComplexArray | None = None,
               most: int = 1 << 16) -> FloatArray:
    """Return the variance of each motion's rows by a unit of variance in each bin of its force, shape (n, bins, bins).

    A resonance is narrower than a bin, and seen in the tails of other bins' windows. No peak is narrower than the
    record is long: what it shows of the response is that with a rate of decay 1/T more. `change` (nw, n): by how much
    of itself each motion's impedance is less at `omega_fine`, as the damping of an effect makes it. `most`: frequencies
    at most.
    """
    block = run.basis[len(run.basis) // 2]
    size = min(1 << int(np.ceil(np.log2(2.0 * np.pi * max(run.time.size, block.g.shape[1])))), most)
    at = np.asarray(2.0 * np.pi * np.fft.rfftfreq(size, run.dt), dtype=np.float64)
    at = at[at <= block.omega[-1] + block.omega[0]]
    power = np.abs(np.fft.rfft(block.g, size, axis=1)[:, : at.size]) ** 2
    power /= np.sum(power, axis=1)[:, None]
    Z = np.einsum("wii->iw", stiffened(model, run, at, change))
    first = np.searchsorted(at, 0.5 * (block.omega[1:] + block.omega[:-1]))
    return np.stack([np.add.reduceat(power * one, np.r_[0, first], axis=1) for one in np.abs(Z) ** -2.0])
