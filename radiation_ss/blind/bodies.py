"""Random floating bodies: what the model file says of them and what they really are."""

from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.data import HydroData

RHO, G = 1000.0, 9.81


@dataclass(frozen=True)
class Mode:
    """One positive-real mode R (s + d) / (s^2 + c1 s + c0) of the memory, R positive semi-definite, 0 <= d <= c1."""

    R: FloatArray
    d: float
    c1: float
    c0: float

    def transfer(self, omega: FloatArray) -> ComplexArray:
        """Return K(iw), shape (nw, n, n)."""
        s = 1j * omega
        shape = (s + self.d) / (s**2 + self.c1 * s + self.c0)
        return np.asarray(shape[:, None, None] * self.R, dtype=np.complex128)

    def kernel(self, time: FloatArray) -> FloatArray:
        """Return L(t), shape (n, n, nt): damped cosine and sine."""
        alpha = 0.5 * self.c1
        beta = np.sqrt(self.c0 - alpha**2)
        shape = np.exp(-alpha * time) * (np.cos(beta * time) + (self.d - alpha) / beta * np.sin(beta * time))
        return self.R[:, :, None] * shape


@dataclass(frozen=True)
class Body:
    """A floating body: inertia, stiffness, memory, exciting force; the truth or the nominal one."""

    dofs: tuple[str, ...]
    # M, A_inf, C (n, n)
    M: FloatArray
    A_inf: FloatArray
    C: FloatArray
    modes: tuple[Mode, ...]
    force: ComplexArray  # (n,): Size of the exciting force per metre of elevation in long waves [N/m or N]
    # depth_decay, phase: Smith effect exp(-k depth_decay) and the force's phase per wave number [m]
    depth_decay: float
    phase: float
    size: float  # Half-breadth [m]
    gain: float = 1.0  # Factor on the exciting force

    def K(self, omega: FloatArray) -> ComplexArray:
        """Return the radiation transfer function, shape (nw, n, n)."""
        return np.sum([mode.transfer(omega) for mode in self.modes], axis=0)

    def kernel(self, dt: float) -> FloatArray:
        """Return L at 0, dt, ... until it has decayed to 1e-5, latest first, shape (n, n, nk)."""
        slowest = min(0.5 * mode.c1 for mode in self.modes)
        time = np.arange(0.0, np.log(1e5) / slowest, dt)
        return np.ascontiguousarray(np.sum([mode.kernel(time) for mode in self.modes], axis=0)[:, :, ::-1])

    def X(self, omega: FloatArray) -> ComplexArray:
        """Return the exciting force per metre of elevation, shape (nw, n)."""
        k = omega**2 / G
        return self.gain * np.exp(-k * self.depth_decay + 1j * k * self.phase)[:, None] * self.force

    def frequencies(self) -> FloatArray:
        """Return the natural frequencies [rad/s] with the added mass at infinite frequency, one for each dof."""
        return np.sqrt(np.diag(self.C) / np.diag(self.M + self.A_inf))

    def data(self) -> HydroData:
        """Return the body as coefficients on a frequency grid, as a model file holds them."""
        top = self.frequencies().max()
        omega = np.unique(np.concatenate([np.linspace(0.08, 3.0, 40), np.linspace(3.2, 7.0, 12)])) * top
        K = self.K(omega)
        return HydroData(omega=omega, A=self.A_inf + K.imag / omega[:, None, None], B=K.real, A_inf=self.A_inf,
                         dofs=self.dofs, rho=RHO, g=G, M=self.M, C=self.C, X=self.X(omega)[:, None, :])


def heave(rng: np.random.Generator) -> Body:
    """Return a body that heaves: section of random breadth, draft and fullness, of random length."""
    half, ratio, slender, full = rng.uniform((0.08, 0.6, 2.0, 0.7), (0.30, 1.6, 6.0, 0.98))
    draft, length = half * ratio, half * slender
    M = RHO * 2 * half * draft * full * length
    C, A_inf = RHO * G * 2 * half * length, M * rng.uniform(0.6, 1.3)
    damping = 2.0 * rng.uniform(0.06, 0.20) * np.sqrt(C * (M + A_inf))
    modes = memory(np.sqrt(C / (M + A_inf)), one(1.0), damping, rng)
    return Body(("Heave",), one(M), one(A_inf), one(C), modes, np.array([C + 0j]), 0.7 * draft, 0.2 * half, half)


def roll(rng: np.random.Generator) -> Body:
    """Return a body that rolls: lightly damped."""
    half, ratio, slender, gm = rng.uniform((0.10, 0.5, 3.0, 0.10), (0.45, 1.2, 8.0, 0.35))
    draft, length = half * ratio, half * slender
    mass = RHO * 2 * half * draft * 0.9 * length
    inertia, C = mass * (0.7 * half) ** 2, mass * G * gm * half
    A_inf = inertia * rng.uniform(0.1, 0.35)
    damping = 2.0 * rng.uniform(0.008, 0.04) * np.sqrt(C * (inertia + A_inf))
    modes = memory(np.sqrt(C / (inertia + A_inf)), one(1.0), damping, rng)
    force = 0.3 * RHO * G * length * half**3
    return Body(("Roll",), one(inertia), one(A_inf), one(C), modes, np.array([1j * force / half]), 0.5 * draft,
                0.2 * half, half)


def sway_roll(rng: np.random.Generator) -> Body:
    """Return a body that sways on a soft mooring and rolls; inertia and memory couple the two."""
    rolling = roll(rng)
    half = rolling.size
    inertia = float(rolling.M[0, 0])
    mass = inertia / (0.7 * half) ** 2
    lever = half * rng.uniform(-0.25, 0.25)
    M = np.array([[mass, mass * lever], [mass * lever, inertia + mass * lever**2]])
    added = mass * rng.uniform(0.4, 0.8)
    arm = half * rng.uniform(-0.2, 0.2)
    A_inf = np.array([[added, added * arm], [added * arm, added * arm**2 + float(rolling.A_inf[0, 0])]])
    soft = (mass + added) * (rng.uniform(0.25, 0.5) * np.sqrt(float(rolling.C[0, 0]) / inertia)) ** 2
    C = np.diag([soft, float(rolling.C[0, 0])])
    omega = float(np.sqrt(C[1, 1] / (M[1, 1] + A_inf[1, 1])))
    level = np.array([2.0 * rng.uniform(0.05, 0.15) * omega * (mass + added),
                      2.0 * rng.uniform(0.008, 0.03) * omega * (M[1, 1] + A_inf[1, 1])])
    lean = rng.uniform(-0.7, 0.7) * np.sqrt(level[0] * level[1])
    shape = np.array([[level[0], lean], [lean, level[1]]])
    modes = memory(omega, shape / level[0], float(level[0]), rng)
    push = RHO * G * 2 * half * 4 * half * 0.5
    return Body(("Sway", "Roll"), M, A_inf, C, modes, np.array([1j * push, 1j * push * half * rng.uniform(-0.3, 0.3)]),
                0.4 * half, 0.2 * half, half)


def six(rng: np.random.Generator, moored: bool) -> Body:
    """Return a body with six degrees of freedom, free in the horizontal plane or on a soft linear mooring."""
    half, ratio, slender, full = rng.uniform((0.15, 0.5, 2.5, 0.75), (0.4, 1.0, 5.0, 0.95))
    beam, length, draft = 2.0 * half, half * slender, half * ratio
    mass, area = RHO * beam * length * draft * full, RHO * G * beam * length
    gyration = np.array([0.35 * beam, 0.26 * length, 0.27 * length])
    height = draft * rng.uniform(-0.4, 0.1)
    M = np.diag(np.concatenate([np.full(3, mass), mass * gyration**2]))
    M[0, 4] = M[4, 0] = mass * height
    M[1, 3] = M[3, 1] = -mass * height
    added = np.diag(M) * rng.uniform((0.05, 0.3, 0.7, 0.1, 0.5, 0.2), (0.2, 0.8, 1.2, 0.3, 1.0, 0.5))
    lean = lever(0.4 * draft * rng.uniform(-1.0, 1.0))
    A_inf = lean @ np.diag(added) @ lean.T
    C = np.zeros(6)
    C[2:5] = area, mass * G * rng.uniform(0.1, 0.3) * half, mass * G * 0.08 * length**2 / draft
    inertia = np.diag(M) + np.diag(A_inf)
    omega = float(np.sqrt(C[2] / inertia[2]))
    if moored:
        C[[0, 1, 5]] = inertia[[0, 1, 5]] * (omega * rng.uniform(0.12, 0.25, 3)) ** 2
    share = rng.uniform((0.01, 0.04, 0.05, 0.01, 0.05, 0.01), (0.03, 0.1, 0.15, 0.03, 0.12, 0.04))
    level = 2.0 * share * omega * inertia
    modes = memory(omega, lean @ np.diag(level) @ lean.T / level[2], float(level[2]), rng)
    push = area * np.array([0.3j * draft / length, 0.5j * draft / beam, 1.0,
                            0.04j * half, 0.1j * length, 0.02 * length])
    return Body(("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw"), M, A_inf, np.diag(C), modes, push, 0.7 * draft,
                0.2 * half, half)


def lever(arm: float) -> FloatArray:
    """Return the matrix that moves horizontal forces down by an arm: they turn roll and pitch."""
    found = np.eye(6)
    found[4, 0], found[3, 1] = -arm, arm
    return found


BODIES = {"heave": heave, "roll": roll, "sway-roll": sway_roll, "six-free": lambda rng: six(rng, False),
          "six-moored": lambda rng: six(rng, True)}


def one(value: float) -> FloatArray:
    """Return a 1 x 1 matrix."""
    return np.array([[float(value)]])


def memory(omega: float, shape: FloatArray, damping: float, rng: np.random.Generator) -> tuple[Mode, ...]:
    """Return two modes near the natural frequency that damp there by `damping` times `shape`; K(0) is 0 or not."""
    first, second = omega * rng.uniform(0.8, 1.4), omega * rng.uniform(1.7, 2.6)
    c1 = first * rng.uniform(0.7, 1.3)
    open_sea = rng.random() < 0.5
    d = 0.0 if open_sea else c1 * rng.uniform(0.2, 0.6)
    modes = [Mode(shape, d, c1, first**2), Mode(rng.uniform(0.1, 0.35) * shape, 0.0, second * 0.9, second**2)]
    level = np.sum([mode.transfer(np.array([omega]))[0, 0, 0].real for mode in modes])
    scale = damping * float(shape[0, 0]) / level
    return tuple(replace(mode, R=scale * mode.R) for mode in modes)


def truth(nominal: Body, tolerance: float, rng: np.random.Generator) -> tuple[Body, dict[str, float]]:
    """Return what the body really is: every nominal number off by up to its tolerance, one mode more in the memory.

    In half of the bodies each number sits at the very edge of its tolerance. The extra mode lies above the frequencies
    of the motion and has at most the tolerance of the memory's largest value.
    """
    edge = rng.random() < 0.5

    def error() -> float:
        return tolerance * float(rng.choice([-1.0, 1.0]) if edge else rng.uniform(-1.0, 1.0))

    n = len(nominal.dofs)
    off = {}
    parts = {}
    for name in ("M", "C", "A_inf"):
        factor = np.ones((n, n))
        for i in range(n):
            for j in range(i, n):
                factor[i, j] = factor[j, i] = 1.0 + error()
                off[f"{name}{i}{j}"] = float(factor[i, j] - 1.0)
        parts[name] = getattr(nominal, name) * factor
    off["kernel"], off["force"] = error(), error()
    omega = float(nominal.frequencies().max())
    top = omega * rng.uniform(2.8, 4.5)
    c1 = top * rng.uniform(0.25, 0.5)
    largest = np.abs(nominal.K(np.linspace(0.2, 3.0, 60) * omega)).max(axis=0)
    extra = Mode(np.diag(np.diag(largest)) * tolerance * rng.uniform(0.3, 1.0) * c1, 0.0, c1, top**2)
    modes = tuple(replace(mode, R=mode.R * (1.0 + off["kernel"])) for mode in nominal.modes) + (extra,)
    off["edge"] = float(edge)
    return replace(nominal, modes=modes, gain=1.0 + off["force"], **parts), off
