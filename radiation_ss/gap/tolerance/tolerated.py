"""What a model may be off by within its tolerances although no nominal number describes it.

A memory that has one more mode than the fitted one, an exciting force whose size and phase ripple over frequency: what
such errors do to the readings, by the linear model along the motion of the fit without effects.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.fit.rational import frequency_response
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.linear import frequencies, paths, receptance
from radiation_ss.gap.tolerance.input_noise import input_errors
from radiation_ss.simulation.prepare import QUANTITIES

LOW, HIGH, STEP = 0.5, 5.0, 1.2  # where the memory may be off: below the lowest to above the highest natural frequency
WIDTHS = (0.25, 0.5)  # of such a mode, relative to its frequency
WAVES = np.linspace(1.0, 6.0, 6)  # ripples over the logarithm of frequency by which the exciting force may be off
DRAWS, DIRECTIONS = 200, 96  # of the principal directions: draws that they come from, at most so many of a kind
SHOWS = 0.35  # standard deviations of the noise that a direction must reach over all records


def tolerated(null: Fit, rng: np.random.Generator, replicates: int) -> list[FloatArray]:
    """Return residuals of a model that is off within its tolerances, one column for each replicate, by channel.

    In half of the replicates every number sits at the very edge of its tolerance.
    """
    count = len(null.problem.setting.nominal)
    q, size = sized(count, replicates, rng)
    nominal = [slopes[:, :count] @ q for slopes in null.point.slopes or []]
    parts = zip(nominal, unnamed(null, rng, replicates), noisy_inputs(null, rng, replicates))
    return [a + b * size + c for a, b, c in parts]


def sized(count: int, replicates: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return `count` relative errors between -1 and 1 tolerances for each replicate, and one between 0 and 1.

    In half of the replicates all of them sit at the edge.
    """
    inner = rng.uniform(-1.0, 1.0, (count, replicates))
    edge = rng.random(replicates) < 0.5
    return np.where(edge, np.sign(inner), inner), np.where(edge, 1.0, rng.uniform(0.0, 1.0, replicates))


def unnamed(null: Fit, rng: np.random.Generator, replicates: int) -> list[FloatArray]:
    """Return what errors at the edge of the tolerance do to each channel that no nominal number describes."""
    parts = [memory_errors(null, rng, replicates), force_errors(null, rng, replicates)]
    return [sum((unit[k] @ draws for unit, draws in parts), np.zeros((r.size, replicates)))
            for k, r in enumerate(null.point.residuals)]


def noisy_inputs(null: Fit, rng: np.random.Generator, replicates: int) -> list[FloatArray]:
    """Return what the noise of recorded forces and elevations does to each channel."""
    columns = input_errors(null)
    draws = rng.standard_normal((columns[0].shape[1], replicates))
    return [part @ draws for part in columns]


def discrepancy(null: Fit, floors: Sequence[float], rng: np.random.Generator) -> tuple[tuple[FloatArray, ...], int]:
    """Return the principal directions of what no nominal number describes, as large as one standard deviation.

    With them free, an effect is not credited with what a tolerated error of the memory or the force explains, nor with
    what the recorded force's own noise does. Those that stay well below the sensors' noise are left out. The second
    value counts the directions of tolerated errors, which come first; the others are the records' own.
    """
    ends = np.cumsum([r.size for r in null.point.residuals])[:-1]
    model, inputs = (principal(np.concatenate([part / floor for part, floor in zip(parts, floors)]))
                     for parts in ([part / np.sqrt(DRAWS) for part in unnamed(null, rng, DRAWS)], input_errors(null)))
    columns = np.split(np.concatenate([model, inputs], axis=1), ends)
    return tuple(part * floor for part, floor in zip(columns, floors)), model.shape[1]


def principal(columns: FloatArray) -> FloatArray:
    """Return the principal directions of independent unit normal columns that stand out of unit noise."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    keep = min(int(np.count_nonzero(values > SHOWS**2)), DIRECTIONS)
    return np.asarray(columns @ vectors[:, ::-1][:, :keep])


def mode_frequencies(null: Fit) -> FloatArray:
    """Return the frequencies at which the memory may have one more mode [rad/s], the same for all degrees of freedom.

    Coupled motion of one degree of freedom holds the frequencies of the others.
    """
    natural = [scale.omega for scale in null.problem.setting.scales.values()]
    low, high = LOW * min(natural), HIGH * max(natural)
    return np.geomspace(low, high, 1 + int(np.ceil(np.log(high / low) / np.log(STEP))))


def memory_errors(null: Fit, rng: np.random.Generator, replicates: int) -> tuple[list[FloatArray], FloatArray]:
    """Return what one more mode of the memory, as large as the tolerance, does to each channel, and a draw of modes.

    The mode is c1 s / (s^2 + c1 s + w^2) times the tolerance of the memory's largest value, on one degree of freedom;
    the draw picks one mode for each degree of freedom of each replicate, with a random sign.
    """
    setting = null.problem.setting
    model, share = setting.model, setting.tolerance.get("kernel", 0.0)
    if model.fit.states == 0 or share == 0.0:
        return nothing(null, replicates)
    shapes = [(w, width * w) for w in mode_frequencies(null) for width in WIDTHS]
    forces: list[list[ComplexArray]] = []  # of each record: one spectrum for each mode on each degree of freedom
    for motion in paths(null):
        omega = frequencies(motion["padded"], motion["h"])
        spectra = []
        for i in range(model.n):
            natural = setting.scales[model.dofs[i]].omega
            K = frequency_response(model.fit.a, model.fit.b, model.fit.c, natural * np.geomspace(0.1, 10.0, 200))
            largest = share * float(np.abs(K[:, i, i]).max())
            v = np.fft.rfft(motion["v"][:, i], motion["padded"])
            spectra += [unit_force(i, model.n, -largest * 1j * c1 * omega / (w**2 - omega**2 + 1j * c1 * omega) * v)
                        for w, c1 in shapes]
        forces.append(spectra)
    picked = rng.integers(len(shapes), size=(model.n, replicates))
    draws = np.zeros((model.n * len(shapes), replicates))
    for i in range(model.n):
        draws[i * len(shapes) + picked[i], np.arange(replicates)] = rng.choice([-1.0, 1.0], replicates)
    return readings(null, forces), draws


def force_errors(null: Fit, rng: np.random.Generator, replicates: int) -> tuple[list[FloatArray], FloatArray]:
    """Return what ripples of the exciting force over frequency do to each channel, and a draw of ripples.

    The force is off by the factor 1 + share e^(i psi) cos(k log w + phi), with k, psi and phi drawn for each degree of
    freedom: its size and phase change with frequency, which no nominal number describes.
    """
    setting = null.problem.setting
    model, share = setting.model, setting.tolerance.get("force", 0.0)
    if not setting.forced or share == 0.0:
        return nothing(null, replicates)
    forces = []
    for prepared, motion in zip(setting.records, paths(null)):
        omega = frequencies(motion["padded"], motion["h"])
        log = np.log(np.maximum(omega, omega[1]))
        spectra = []
        for i in range(model.n):
            force = prepared.followed[i]
            acting = force(np.clip(prepared.grid, *force.x[[0, -1]]))
            F = share * np.fft.rfft(acting, motion["padded"])
            spectra += [unit_force(i, model.n, turn * wave(k * log) * F)
                        for k in WAVES for turn in (1.0, 1j) for wave in (np.cos, np.sin)]
        forces.append(spectra)
    draws = np.zeros((model.n * WAVES.size * 4, replicates))
    for i in range(model.n):
        start = 4 * (i * WAVES.size + rng.integers(WAVES.size, size=replicates))
        psi, phi = rng.uniform(0.0, 2.0 * np.pi, (2, replicates))
        parts = (np.cos(psi) * np.cos(phi), -np.cos(psi) * np.sin(phi), np.sin(psi) * np.cos(phi),
                 -np.sin(psi) * np.sin(phi))
        for j, part in enumerate(parts):
            draws[start + j, np.arange(replicates)] = part
    return readings(null, forces), draws


def nothing(null: Fit, replicates: int) -> tuple[list[FloatArray], FloatArray]:
    """Return no direction and an empty draw."""
    return [np.zeros((r.size, 0)) for r in null.point.residuals], np.zeros((0, replicates))


def unit_force(i: int, n: int, spectrum: ComplexArray) -> ComplexArray:
    """Return the spectra of a force on one degree of freedom, shape (nw, n)."""
    found = np.zeros((spectrum.size, n), dtype=np.complex128)
    found[:, i] = spectrum
    return found


def readings(null: Fit, forces: Sequence[Sequence[ComplexArray]]) -> list[FloatArray]:
    """Return what forces do to each channel by the linear model; forces of shape (nw, n) for each record."""
    setting = null.problem.setting
    found: list[FloatArray] = []
    for prepared, motion, spectra in zip(setting.records, paths(null), forces):
        omega = frequencies(motion["padded"], motion["h"])
        H = receptance(setting.model, omega)
        for channel in prepared.channels:
            turn = (1j * omega) ** QUANTITIES.index(channel.quantity)
            rows = [np.fft.irfft(np.einsum("wj,wj->w", H[:, channel.dof], one) * turn, motion["padded"])
                    for one in spectra]
            values = [np.interp(channel.time, prepared.grid, row[: prepared.grid.size]) for row in rows]
            found.append(setting.without_slow(len(found), np.stack(values, axis=1)))
    return found


def retuned(found: Fit) -> FloatArray:
    """Return q with the discrepancy handed over to the nominal numbers as far as they can take it, to first order.

    The discrepancy belongs to the records that it was fitted to. What of it a nominal number does as well has to go
    into the model that predicts others; effects keep their strength, and the noise of a recorded force is dropped.
    """
    setting, q = found.problem.setting, found.q.copy()
    if not setting.unnamed:
        return q
    _, J = found.whitened()
    starts = [c for columns in found.problem.start_columns for c in columns]
    free = np.array([*range(len(setting.nominal)), *starts])
    first = q.size - setting.unnamed
    handed = np.arange(first, first + setting.tolerated)
    rest = J[:, handed] @ q[handed]
    q[free] += np.linalg.solve(J[:, free].T @ J[:, free] + np.eye(free.size), J[:, free].T @ rest)
    q[-setting.unnamed:] = 0.0
    return q
