"""How the wave excitation force moves when nobody measures it: persistence (19), or a coloured force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError


@dataclass(frozen=True, eq=False)
class ForceModel:
    """Force of each degree of freedom as the first of two states, s' = A s + white noise.

    A (n, 2, 2); q (n, 2), noise intensities of the two states; start (n, 2), variances at the start.
    """

    A: FloatArray
    q: FloatArray
    start: FloatArray
    name: str


def coloured(std: ArrayLike, omega: ArrayLike, bandwidth: ArrayLike) -> ForceModel:
    """Return a stationary narrow-band force f'' + 2 zeta w f' + w^2 f = white noise, for each degree of freedom.

    std [N, N m] is its standard deviation, omega its mean frequency [rad/s], bandwidth zeta. In a gap of the record its
    spread opens to `std` and no further, which persistence cannot offer.
    """
    sigma, w, zeta = (np.atleast_1d(np.asarray(v, dtype=float)) for v in (std, omega, bandwidth))
    _positive(sigma=sigma, omega=w, bandwidth=zeta)
    A = np.zeros((sigma.size, 2, 2))
    A[:, 0, 1], A[:, 1, 0], A[:, 1, 1] = 1.0, -w**2, -2.0 * zeta * w
    q = np.stack([np.zeros_like(w), 4.0 * zeta * w**3 * sigma**2], axis=1)
    return ForceModel(A, q, np.stack([sigma**2, (w * sigma) ** 2], axis=1), "coloured")


def persistence(std: ArrayLike, omega: ArrayLike) -> ForceModel:
    """Return the random walk of (19), its steps as large as those of a force of this size and frequency.

    Over a time dt a smooth force moves by w std dt; the walk's intensity makes that its standard deviation over a
    twentieth of a period.
    """
    sigma, w = (np.atleast_1d(np.asarray(v, dtype=float)) for v in (std, omega))
    _positive(sigma=sigma, omega=w)
    q = np.stack([(w * sigma) ** 2 * (2.0 * np.pi / w / 20.0), np.zeros_like(w)], axis=1)
    return ForceModel(np.zeros((sigma.size, 2, 2)), q, np.stack([sigma**2, np.zeros_like(w)], axis=1), "persistence")


def _positive(**values: FloatArray) -> None:
    for name, value in values.items():
        if not np.all(value > 0.0):
            raise InputError(f"force model: {name} must be positive, found {value}")
