"""Closed bodies for tests of the plant, waves and simulation: no files, every number with its source."""

import numpy as np
from scipy.linalg import block_diag

from radiation_ss import Model, RadiationFit

# Hanaki, Takaoka, Minoura (2022), Table 3, Case 2: passive, order 3; times rho = 1000 and a length of 0.297 m.
DENOMINATOR = np.array([1093.3195, 236.4745, 22.6247])
NUMERATOR = np.array([107.4617, 12.6381, 0.5801]) * 1000.0 * 0.297


def tank_fit(dof="Heave"):
    """The paper's heave memory in its observer form (5)-(8)."""
    a = np.array([[0.0, 0.0, -DENOMINATOR[0]], [1.0, 0.0, -DENOMINATOR[1]], [0.0, 1.0, -DENOMINATOR[2]]])
    return RadiationFit((dof,), a, NUMERATOR[:, None], np.array([[0.0, 0.0, 1.0]]), 3)


def tank_model():
    """The paper's body in heave: 52.4 N, A_inf 1.95 rho b^2 l, C = rho g S."""
    return Model(("Heave",), [[52.4 / 9.81]], [[1.95 * 1000.0 * 0.01 * 0.297]], [[1000.0 * 9.81 * 0.0594]], tank_fit())


def coupled_fit(dofs, seed=0, pairs=2):
    """A passive, reciprocal memory: port-Hamiltonian a = J - R with c = b' (positive real for any seed)."""
    rng = np.random.default_rng(seed)
    n = len(dofs)
    blocks, columns = [], []
    for _ in range(pairs * n):
        w, z = rng.uniform(0.4, 2.0), rng.uniform(0.3, 0.9)
        blocks.append(np.array([[-2.0 * z * w, -w], [w, 0.0]]))
        columns.append(np.stack([rng.standard_normal(n) * 400.0, np.zeros(n)]))
    b = np.concatenate(columns)
    return RadiationFit(tuple(dofs), block_diag(*blocks), b, b.T, 2 * pairs * n)


def coupled_model(dofs=("Sway", "Roll"), seed=0):
    """Several degrees of freedom with a full mass matrix, restored in each."""
    n = len(dofs)
    rng = np.random.default_rng(seed + 100)
    half = rng.standard_normal((n, n)) * 0.2
    M = 1e6 * (np.eye(n) + half @ half.T)
    return Model(tuple(dofs), M, 0.6 * M, 1e6 * np.diag(rng.uniform(0.5, 1.5, n)), coupled_fit(dofs, seed))


def convolution_response(inertia, stiffness, L, dt, force, displacement):
    """Return the displacement (n, nt) by (M + A_inf) xi'' + int_0^t L(t - tau) xi'(tau) dtau + C xi = f (n, nt).

    The trapezoidal rule for the equation of motion (average acceleration) and for the convolution: the error falls as
    dt^2, and nothing is assumed of the kernel L (nk, n, n), which is zero after its end.
    """
    n, f = len(inertia), force.T
    x, v, a = (np.zeros((f.shape[0], n)) for _ in range(3))
    x[0] = displacement
    a[0] = np.linalg.solve(inertia, f[0] - stiffness @ x[0])
    now = 0.5 * dt * L[0]  # the part of the integral that the newest velocity has
    lhs = np.linalg.inv(inertia + 0.5 * dt * now + 0.25 * dt**2 * stiffness)
    past = np.ascontiguousarray(dt * L[1:].transpose(0, 2, 1))
    for k in range(1, f.shape[0]):
        depth = min(k, past.shape[0])
        memory = np.tensordot(v[k - depth:k][::-1], past[:depth], axes=([0, 1], [0, 1]))
        if depth == k:
            memory -= 0.5 * past[k - 1].T @ v[0]  # end weight of the trapezoidal rule
        ahead_v = v[k - 1] + 0.5 * dt * a[k - 1]
        ahead_x = x[k - 1] + dt * v[k - 1] + 0.25 * dt**2 * a[k - 1]
        a[k] = lhs @ (f[k] - memory - now @ ahead_v - stiffness @ ahead_x)
        v[k] = ahead_v + 0.5 * dt * a[k]
        x[k] = ahead_x + 0.25 * dt**2 * a[k]
    return x.T
