"""The Cummins equation with its convolution integral done as one: the reference for every state-space shortcut."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.errors import InputError


def convolution_response(inertia: ArrayLike, stiffness: ArrayLike, kernel: ArrayLike, dt: float, force: ArrayLike, *,
                         damping: ArrayLike | None = None, displacement: ArrayLike | None = None,
                         velocity: ArrayLike | None = None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Integrate (M + A_inf) xi'' + D xi' + int_0^t L(t - tau) xi'(tau) dtau + C xi = f by the trapezoidal rule.

    Both the equation of motion (average acceleration) and the convolution use the trapezoidal rule, so the error falls
    as dt^2 and nothing is assumed of the kernel: it may come straight from data. The cost is nt times the kernel.

    Parameters
    ----------
    inertia, stiffness : array_like, shape (n, n)
        M + A_inf and C, SI.
    kernel : array_like, shape (nk, n, n)
        L(t) at t = 0, dt, 2 dt ...; zero after its end.
    dt : float
        Time step [s].
    force : array_like, shape (n, nt)
        Force at the samples.
    damping : array_like, shape (n, n), optional
        Linear damping D.
    displacement, velocity : array_like, shape (n,), optional
        Initial motion; no motion before.

    Returns
    -------
    displacement, velocity, acceleration : ndarray, each of shape (n, nt)

    Raises
    ------
    InputError
        If shapes do not fit or dt is not positive.
    """
    if not dt > 0.0:
        raise InputError(f"dt: {dt:g} s; a positive time step is needed")
    L = read_only(kernel, "kernel", (None, None, None))
    n = L.shape[1]
    M, C = read_only(inertia, "inertia", (n, n)), read_only(stiffness, "stiffness", (n, n))
    D = np.zeros((n, n)) if damping is None else read_only(damping, "damping", (n, n))
    f = read_only(np.atleast_2d(np.asarray(force, dtype=float)), "force", (n, None)).T
    x, v, a = (np.zeros((f.shape[0], n)) for _ in range(3))
    x[0] = 0.0 if displacement is None else read_only(displacement, "displacement", (n,))
    v[0] = 0.0 if velocity is None else read_only(velocity, "velocity", (n,))
    a[0] = np.linalg.solve(M, f[0] - D @ v[0] - C @ x[0])
    now = D + 0.5 * dt * L[0]  # the part of the integral that the newest velocity has
    lhs = np.linalg.inv(M + 0.5 * dt * now + 0.25 * dt**2 * C)
    past = np.ascontiguousarray(dt * L[1:].transpose(0, 2, 1))
    for k in range(1, f.shape[0]):
        depth = min(k, past.shape[0])
        memory = np.tensordot(v[k - depth:k][::-1], past[:depth], axes=([0, 1], [0, 1]))
        if depth == k:
            memory -= 0.5 * past[k - 1].T @ v[0]  # end weight of the trapezoidal rule
        ahead_v = v[k - 1] + 0.5 * dt * a[k - 1]
        ahead_x = x[k - 1] + dt * v[k - 1] + 0.25 * dt**2 * a[k - 1]
        a[k] = lhs @ (f[k] - memory - now @ ahead_v - C @ ahead_x)
        v[k] = ahead_v + 0.5 * dt * a[k]
        x[k] = ahead_x + 0.25 * dt**2 * a[k]
    return x.T, v.T, a.T
