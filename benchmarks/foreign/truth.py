"""Three ways to compute the motion of a floating body, written from the textbook equations (nothing of radiation_ss).

1. `convolve`: Cummins' equation, Newmark's average acceleration, the memory integral by the trapezoidal rule.
2. `prony`: the memory as a sum of many exponentials (damped modes fitted to K(t)), integrated by scipy's DOP853.
3. `linear`: the linear equation by a numerical Laplace transform (reference for the other two and the nominal model).

All take a `Body` and `Effects`. Motion x, velocity v; forces act on the right-hand side.
"""

from dataclasses import dataclass, field, replace

import numba
import numpy as np
import xarray as xr
from scipy.fft import next_fast_len
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

# columns of Effects.table, one row for each degree of freedom
COLUMNS = (
    "linear_damping",
    "quadratic_drag",
    "coulomb_friction",
    "coulomb_speed",
    "linear_stiffness",
    "quadratic_stiffness",
    "cubic_stiffness",
    "line_stiffness",
    "line_slack",
    "line_both",
    "constant_force",
    "bw_stiffness",
    "bw_beta",
    "bw_gamma",
    "tank_gain",
    "tank_omega",
    "tank_zeta",
    "pto_damping",
    "pto_lag",
    "lift_damping",
)
KERNELS = {}  # kernels that were computed already
C = {name: i for i, name in enumerate(COLUMNS)}


@dataclass(frozen=True)
class Body:
    """Linear body: M, A_inf, stiffness (n, n); kernel K (nt, n, n) at times k dt; exciting force X (nw, n) at omega."""

    dofs: tuple
    M: np.ndarray
    A_inf: np.ndarray
    stiffness: np.ndarray
    omega: np.ndarray
    B: np.ndarray
    A: np.ndarray
    X: np.ndarray
    D: np.ndarray  # linear damping of the nominal model (n,), diagonal: roll, and the rig's soft springs

    def kernel(self, dt, duration):
        key = (self.B.tobytes(), dt, duration)
        if key not in KERNELS:
            KERNELS[key] = kernel(self.omega, self.B, dt, duration)
        return KERNELS[key]


@dataclass
class Effects:
    n: int
    table: np.ndarray = None
    added_inertia: np.ndarray = None
    memory: float = 1.0
    extra: dict = field(default_factory=dict)

    def __post_init__(self):
        if self.table is None:
            self.table = np.zeros((self.n, len(COLUMNS)))
            self.table[:, C["coulomb_speed"]] = self.table[:, C["tank_omega"]] = self.table[:, C["pto_lag"]] = 1.0
        if self.added_inertia is None:
            self.added_inertia = np.zeros((self.n, self.n))

    def put(self, dof, **values):
        for name, value in values.items():
            self.table[dof, C[name]] = value
        return self


def load(path, dofs=None):
    """Body from a Capytaine dataset that has omega = inf."""
    data = xr.open_dataset(path).load()
    dofs = tuple(str(d) for d in data.radiating_dof.values) if dofs is None else tuple(dofs)
    data = data.sel(radiating_dof=list(dofs), influenced_dof=list(dofs))
    data = data.transpose("omega", "complex", "wave_direction", "influenced_dof", "radiating_dof")
    finite = np.isfinite(data.omega.values)
    w = data.omega.values[finite]
    A = data.added_mass.values
    A_inf = 0.5 * (A[~finite][0] + A[~finite][0].T)
    A, B = A[finite], data.radiation_damping.values[finite]
    X = data.excitation_force.isel(wave_direction=0, omega=finite).values  # (omega, complex, dof)
    return Body(
        dofs,
        data.inertia_matrix.values,
        A_inf,
        data.hydrostatic_stiffness.values,
        w,
        positive(0.5 * (B + B.transpose(0, 2, 1))),
        0.5 * (A + A.transpose(0, 2, 1)),
        X[:, 0] + 1j * X[:, 1],
        np.zeros(len(dofs)),
    )


def rig(body, spring_period, damping_ratio=0.03):
    """Soft known springs where the water gives no restoring; known linear damping of roll, surge and sway."""
    stiffness, D = body.stiffness.copy(), np.zeros(len(body.dofs))
    for i, dof in enumerate(body.dofs):
        mass = body.M[i, i] + body.A_inf[i, i]
        if dof in ("Surge", "Sway"):
            stiffness[i, i] = mass * (2 * np.pi / spring_period) ** 2
        if dof in ("Surge", "Sway", "Roll"):
            D[i] = 2 * damping_ratio * np.sqrt(mass * stiffness[i, i])
    return replace(body, stiffness=stiffness, D=D)


def consistent(body):
    """The same body with A(w) computed from its own kernel, so that time and frequency domain are one model."""
    dt = 2 * np.pi / body.omega[-1] / 40
    K = kernel(body.omega, body.B, dt, 60.0 / body.omega[-1] * 3.2)
    t = np.arange(len(K)) * dt
    weight = np.full(t.size, dt)
    weight[[0, -1]] *= 0.5
    A = np.stack([body.A_inf - np.tensordot(weight * np.sin(w * t), K, 1) / w for w in body.omega])
    return replace(body, A=A)


def positive(B):
    """Nearest symmetric matrices without negative eigenvalues (panel methods leave small negative damping)."""
    values, vectors = np.linalg.eigh(B)
    return np.einsum("wij,wj,wkj->wik", vectors, np.maximum(values, 0.0), vectors)


def fine_damping(omega, B, n=2400, factor=3.0):
    """B on a fine grid from 0 to factor * omega_max: a spline, B(0) = 0, and a tail w^-p tapered to zero."""
    top = omega[-1]
    w = np.linspace(0.0, factor * top, n)
    inside = CubicSpline(np.r_[0.0, omega], np.concatenate([np.zeros_like(B[:1]), B]))(np.minimum(w, top))
    slope = (B[-1] - B[-5]) / (omega[-1] - omega[-5])
    p = np.clip(np.where(np.abs(B[-1]) > 0, -slope * top / np.where(B[-1] == 0, 1, B[-1]), 4.0), 2.5, 8.0)
    p = np.full_like(p, np.median(np.diag(p)))
    tail = B[-1] * (np.maximum(w, top)[:, None, None] / top) ** -p
    return w, np.where((w <= top)[:, None, None], inside, tail)


def kernel(omega, B, dt, duration):
    """K(t) = 2/pi int B cos(w t) dw at t = 0, dt, ...; tapered to zero over the last fifth."""
    w, b = fine_damping(omega, B)
    weight = np.full(w.size, w[1] - w[0])
    weight[[0, -1]] *= 0.5
    t = np.arange(int(duration / dt) + 1) * dt
    K = np.empty((t.size, *B.shape[1:]))
    for start in range(0, t.size, 500):
        K[start : start + 500] = 2 / np.pi * np.tensordot(np.cos(np.outer(t[start : start + 500], w)) * weight, b, 1)
    taper = np.clip((duration - t) / (0.2 * duration), 0, 1)
    return K * (0.5 - 0.5 * np.cos(np.pi * taper))[:, None, None]


@numba.njit(cache=True)
def effect_force(t, x, v, z, table, speed):
    """Force and rates of the inner states z[dof, 4]: hysteresis, tank (two), power take-off lag."""
    n = x.size
    f = np.zeros(n)
    rate = np.zeros((n, 4))
    for i in range(n):
        p = table[i]
        f[i] = -(p[0] + p[19] * speed) * v[i] - p[1] * abs(v[i]) * v[i] - p[2] * np.tanh(v[i] / p[3])
        f[i] -= p[4] * x[i] + p[5] * x[i] ** 2 + p[6] * x[i] ** 3
        if x[i] > p[8]:
            f[i] -= p[7] * (x[i] - p[8])
        if p[9] > 0 and x[i] < -p[8]:
            f[i] -= p[7] * (x[i] + p[8])
        f[i] += p[10]
        f[i] -= p[11] * z[i, 0]
        rate[i, 0] = v[i] - p[12] * abs(v[i]) * z[i, 0] - p[13] * v[i] * abs(z[i, 0])
        # outer mode driven by the velocity: force -gain * q', q'' + 2 zeta w q' + w^2 q = v  (passive)
        rate[i, 1] = z[i, 2]
        rate[i, 2] = v[i] - 2 * p[16] * p[15] * z[i, 2] - p[15] ** 2 * z[i, 1]
        f[i] -= p[14] * z[i, 2]
        rate[i, 3] = (v[i] - z[i, 3]) / p[18]
        f[i] -= p[17] * z[i, 3]
    return f, rate


@numba.njit(cache=True)
def _newmark(mass, stiffness, K, dt, force, x0, v0, table, speed, hold):
    steps, n = force.shape
    x = np.zeros((steps, n))
    v = np.zeros((steps, n))
    a = np.zeros((steps, n))
    z = np.zeros((n, 4))
    x[0] = x0
    v[0] = v0
    inverse = np.linalg.inv(mass)
    f, rate = effect_force(0.0, x[0], v[0], z, table, speed)
    a[0] = inverse @ (force[0] + f - stiffness @ x[0])
    lags = K.shape[0]
    for k in range(1, steps):
        past = np.zeros(n)
        for j in range(1, min(k, lags - 1) + 1):
            weight = 0.5 if j == k else 1.0
            for i in range(n):
                for m in range(n):
                    past[i] += weight * K[j, i, m] * v[k - j, m]
        xk = x[k - 1] + dt * v[k - 1] + 0.5 * dt * dt * a[k - 1]
        vk = v[k - 1] + dt * a[k - 1]
        ak = a[k - 1].copy()
        zk = z + dt * rate
        rk = rate
        for _ in range(40):
            fk, rk = effect_force(k * dt, xk, vk, zk, table, speed)
            new = inverse @ (force[k] + fk - stiffness @ xk - dt * (past + 0.5 * K[0] @ vk))
            change = np.max(np.abs(new - ak))
            size = np.max(np.abs(new)) + 1e-12
            ak = new
            vk = v[k - 1] + 0.5 * dt * (a[k - 1] + ak)
            xk = x[k - 1] + dt * v[k - 1] + 0.25 * dt * dt * (a[k - 1] + ak)
            zk = z + 0.5 * dt * (rate + rk)
            if change < 1e-9 * size:
                break
        for i in range(n):
            if hold[i]:
                ak[i] = 0.0
                vk[i] = 0.0
                xk[i] = x[0, i]
        x[k], v[k], a[k], z, rate = xk, vk, ak, zk, rk
    return x, v, a


def convolve(body, effects, dt, force, x0=None, v0=None, speed=0.0, memory_time=None, hold=None):
    """Motion (steps, n): displacement, velocity, acceleration. force (steps, n)."""
    n = len(body.dofs)
    zero = np.zeros(n)
    K = effects.memory * body.kernel(dt, memory_time or 60.0 / body.omega[-1] * 3.2)
    table = effects.table.copy()
    table[:, 0] += body.D
    return _newmark(
        body.M + body.A_inf + effects.added_inertia,
        body.stiffness,
        np.ascontiguousarray(K),
        dt,
        np.ascontiguousarray(force, float),
        zero if x0 is None else np.asarray(x0, float),
        zero if v0 is None else np.asarray(v0, float),
        table,
        speed,
        np.zeros(n, np.bool_) if hold is None else hold,
    )


def prony_fit(K, dt, order):
    """Exponentials s_k, residues R_k (order, n, n): K(t) ~ Re sum R_k exp(s_k t), by a matrix pencil of all entries."""
    samples = K.reshape(K.shape[0], -1)
    rows = K.shape[0] // 2
    hankel = np.concatenate(
        [
            np.lib.stride_tricks.sliding_window_view(column / np.abs(column).max(), rows)
            for column in samples.T
            if np.abs(column).max() > 1e-9 * np.abs(samples).max()
        ],
        0,
    )
    _, _, vt = np.linalg.svd(hankel, full_matrices=False)
    basis = vt[:order].T
    roots = np.linalg.eigvals(np.linalg.lstsq(basis[:-1], basis[1:], rcond=None)[0])
    s = np.log(np.where(np.abs(roots) >= 1, roots / np.abs(roots) * 0.999, roots)) / dt
    t = np.arange(K.shape[0]) * dt
    E = np.exp(np.outer(t, s))
    R = np.linalg.lstsq(
        np.r_[E, 1e-8 * np.eye(order)], np.r_[samples, np.zeros((order, samples.shape[1]))], rcond=None
    )[0]
    error = np.linalg.norm((E @ R).real - samples) / np.linalg.norm(samples)
    return s, R.reshape(order, *K.shape[1:]), error


def prony(body, effects, dt, force, x0=None, v0=None, order=16, speed=0.0, rtol=1e-7):
    """The same equation with the memory as modes, by scipy's DOP853; force is interpolated by a cubic spline."""
    n = len(body.dofs)
    span = 60.0 / body.omega[-1] * 3.2
    s, R, error = prony_fit(effects.memory * body.kernel(span / 300, span), span / 300, order)
    inverse = np.linalg.inv(body.M + body.A_inf + effects.added_inertia)
    t = np.arange(force.shape[0]) * dt
    spline = CubicSpline(t, force)
    table = effects.table.copy()
    table[:, 0] += body.D

    def rhs(time, y):
        x, v, z = y[:n].real, y[n : 2 * n].real, y[2 * n : 6 * n].real.reshape(n, 4)
        modes = y[6 * n :].reshape(order, n)
        f, rate = effect_force(time, x, v, z, table, speed)
        memory = np.einsum("kij,kj->i", R, modes).real
        a = inverse @ (spline(time) + f - body.stiffness @ x - memory)
        return np.concatenate([v, a, rate.ravel(), (s[:, None] * modes + v).ravel()])

    start = np.zeros(6 * n + order * n, complex)
    if x0 is not None:
        start[:n] = x0
    if v0 is not None:
        start[n : 2 * n] = v0
    scale = (
        np.abs(x0).max()
        if x0 is not None and np.any(x0)
        else np.abs(force).max() / np.abs(np.diag(body.M)).max() * dt * dt * 100
    )
    done = solve_ivp(rhs, (0, t[-1]), start, "DOP853", t_eval=t, rtol=rtol, atol=1e-7 * scale, max_step=20 * dt)
    x, v = done.y[:n].real.T, done.y[n : 2 * n].real.T
    return x, v, CubicSpline(t, v).derivative()(t), error


def prepare(dt, force, x0, K, top=np.inf):
    """What the linear solution of one run needs and does not depend on M, A_inf and stiffness (Laplace transforms)."""
    steps = force.shape[0]
    total = next_fast_len(2 * steps, real=True)
    sigma = 12.0 / (total * dt)
    t = np.arange(steps) * dt
    s = sigma + 2j * np.pi * np.fft.rfftfreq(total, dt)
    use = s.imag <= top
    fade = np.exp(-sigma * t)[:, None]
    F = np.fft.rfft(force * fade, total, axis=0)[use] * dt - 0.5 * dt * force[0]
    one = np.fft.rfft(fade, total, axis=0)[use] * dt - 0.5 * dt
    fade_k = np.exp(-sigma * np.arange(len(K)) * dt)[:total, None, None]
    Ks = np.fft.rfft(K[:total] * fade_k, total, axis=0)[use] * dt - 0.5 * dt * K[0]
    return s[use], F, one, Ks, x0, total, np.exp(sigma * t)[:, None] / dt


def respond(body, ready, memory=1.0):
    """Linear motion of a prepared run."""
    s, F, one, Ks, x0, total, back = ready
    s3 = s[:, None, None]
    Z = s3**2 * (body.M + body.A_inf) + s3 * (memory * Ks + np.diag(body.D)) + body.stiffness
    push = F - one * (body.stiffness @ x0)
    Y = push / Z[:, :, 0] if push.shape[1] == 1 else np.linalg.solve(Z, push[..., None])[..., 0]
    return x0 + np.fft.irfft(Y, total, axis=0)[: len(back)] * back


def linear(body, dt, force, x0=None, memory_time=None, K=None):
    """Linear motion by the numerical Laplace transform on s = sigma + i w (start from rest at x0)."""
    x0 = np.zeros(force.shape[1]) if x0 is None else np.asarray(x0, float)
    if K is None:
        K = body.kernel(dt, memory_time or 60.0 / body.omega[-1] * 3.2)
    return respond(body, prepare(dt, force, x0, K))


def excitation(body, omega, amplitude, phase, t):
    """Elevation and exciting force of components a cos(w t + phase), with Capytaine's e^{-iwt}."""
    X = np.stack(
        [
            CubicSpline(body.omega, body.X[:, i])(np.clip(omega, body.omega[0], body.omega[-1]))
            for i in range(len(body.dofs))
        ],
        1,
    )
    wave = amplitude[:, None] * np.exp(-1j * (np.outer(omega, t) + phase[:, None]))
    return wave.real.sum(0), (wave.T @ X).real


def jonswap(omega, hs, tp, gamma=3.3):
    wp = 2 * np.pi / tp
    sigma = np.where(omega <= wp, 0.07, 0.09)
    shape = (
        omega**-5 * np.exp(-1.25 * (wp / omega) ** 4) * gamma ** np.exp(-((omega - wp) ** 2) / (2 * sigma**2 * wp**2))
    )
    return shape * hs**2 / 16 / np.trapezoid(shape, omega)


def irregular(rng, hs, tp, gamma=3.3, n=180, low=0.45, high=3.2):
    wp = 2 * np.pi / tp
    edges = np.linspace(low * wp, high * wp, n + 1)
    omega = edges[:-1] + rng.uniform(0, 1, n) * np.diff(edges)
    return omega, np.sqrt(2 * jonswap(omega, hs, tp, gamma) * (edges[1] - edges[0])), rng.uniform(0, 2 * np.pi, n)


def ramp(t, length):
    return np.where(t < length, 0.5 - 0.5 * np.cos(np.pi * np.clip(t / length, 0, 1)), 1.0)
