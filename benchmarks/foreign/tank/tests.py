"""Tests of a tank: decays, seas, forced oscillation, prescribed motion, static pulls; what acts in them, on half steps."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from hydro import Body, G, forces

# A lively motion of the body of unit size, by body; rotations in rad. Others: heave and horizontal by these rules.
HEAVE = {"sphere": 0.25, "cylinder": 0.3, "spar": 0.6, "barge": 0.16, "ship": 0.16, "semi": 0.45}
ROLL, PITCH = 0.16, 0.07


@dataclass
class Test:
    """One test: what the basin sets (on half steps of h) and what the record says of it."""

    kind: str
    h: float
    steps: int
    x0: np.ndarray
    v0: np.ndarray
    known: np.ndarray  # the force column, by the nominal model
    force: np.ndarray  # the force that acts
    eta: np.ndarray
    water: np.ndarray  # the water's velocity along each degree of freedom
    envelope: np.ndarray  # of the wave
    show: set = field(default_factory=set)  # columns: "force", "eta"
    speed: float | None = None
    guide: tuple | None = None  # x, v, a on whole steps, prescribed
    cut: float = 0.0  # seconds cut from the beginning
    period: float = 1.0  # of what moves most
    span: float = 1.0  # duration, before it is cut to whole steps
    seed: int = 0  # of what befalls this test by chance

    @property
    def half(self) -> np.ndarray:
        return np.arange(2 * self.steps + 1) * self.h / 2


@dataclass(frozen=True)
class Setup:
    """What all tests of a case share: both bodies, the time step, lively motions and natural frequencies."""

    nominal: Body
    true: Body
    h: float
    lively: np.ndarray
    natural: np.ndarray
    actuator: float  # gain of the actuator's force, an error of the nominal model

    def blank(self, kind: str, duration: float) -> Test:
        """Return a test without anything in it."""
        steps, n = int(duration / self.h), self.nominal.n
        zero = np.zeros((2 * steps + 1, n))
        return Test(kind, self.h, steps, np.zeros(n), np.zeros(n), zero, zero, zero[:, 0], zero, zero[:, 0], span=duration)

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Return the nominal motion per unit force, shape (nw, n, n)."""
        b = self.nominal
        A, B = (np.array([np.interp(omega, b.omega, q[:, i, j]) for i in range(b.n) for j in range(b.n)]).T.reshape(
            -1, b.n, b.n) for q in (b.A, b.B))
        w = omega[:, None, None]
        return np.linalg.inv(b.C + 1j * w * (B + b.D) - w**2 * (b.M + A))


def lively(name: str, body: Body) -> np.ndarray:
    """Return a lively amplitude of each degree of freedom."""
    heave = HEAVE.get(name, 0.25) * body.size
    table = {"Heave": heave, "Roll": ROLL, "Pitch": PITCH, "Surge": 2.5 * heave, "Sway": 2.0 * heave}
    return np.array([table[d] for d in body.dofs])


def decay(s: Setup, rng: np.random.Generator, dof: int, part: float, speed: float | None = None) -> Test:
    """Return a release from an offset, `part` of a lively one, or a push; the record may begin a little later."""
    T = 2 * np.pi / s.natural[dof]
    t = s.blank("decay", T * rng.uniform(7, 13))
    x0 = 0.1 * s.lively * rng.uniform(-1, 1, s.nominal.n)
    x0[dof] = part * s.lively[dof] * rng.choice([-1, 1])
    t.x0, t.period, t.speed = x0, T, speed
    t.cut = T * rng.uniform(0.05, 0.6) if rng.random() < 0.35 else 0.0
    if rng.random() < 0.6:
        t.show.add("force")
    return t


def components(s: Setup, rng: np.random.Generator, wp: float, regular: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and complex amplitudes of unit significant height: JONSWAP (Hasselmann et al. 1973), or a wave."""
    if regular:
        return np.array([wp]), np.array([0.5 + 0j])
    low, high = max(0.45 * wp, s.nominal.omega[0]), min(3.2 * wp, s.nominal.omega[-1])
    edge = np.linspace(low, high, 161)
    w = edge[:-1] + np.diff(edge) * rng.random(160)
    gamma, sigma = rng.uniform(1, 5), np.where(w > wp, 0.09, 0.07)
    S = w**-5.0 * np.exp(-1.25 * (wp / w) ** 4) * gamma ** np.exp(-0.5 * ((w / wp - 1) / sigma) ** 2)
    S /= np.sum(S * np.diff(edge)) * 16
    return w, np.sqrt(2 * S * np.diff(edge)) * np.exp(2j * np.pi * rng.random(160))


def sea(s: Setup, rng: np.random.Generator, dof: int, part: float, show: set, regular: bool = False) -> Test:
    """Return a sea that moves the body by `part` of lively (significant), if waves do not break before."""
    top = 0.85 * s.nominal.omega[-1] / (1 if regular else 1.6)
    wave = [w for d, w in zip(s.nominal.dofs, s.natural) if d not in ("Surge", "Sway")] or [s.nominal.omega[-1] * 0.3]
    wp = float(np.clip(rng.choice(wave) * rng.uniform(0.55, 1.35), 2.2 * s.nominal.omega[0], top))
    w, a = components(s, rng, wp, regular)
    T = 2 * np.pi / wp
    longest = 2 * np.pi / s.natural.min()
    t = s.blank("waves", max(T * (rng.uniform(22, 45) if regular else rng.uniform(55, 120)), 6 * longest))
    motion = abs(np.einsum("wij,wj->wi", s.response(w), forces(s.nominal, w)) * a[:, None])
    significant = 4 * np.sqrt(np.sum(motion**2, axis=0) / 2)
    height = part * 2 * min(s.lively / significant)
    height = min(height, (0.06 if regular else 0.05) * 2 * np.pi * G / wp**2)
    ramp = np.where(t.half < 3 * T, 0.5 - 0.5 * np.cos(np.pi * t.half / (3 * T)), 1.0)
    deep = w * np.exp(-0.4 * s.nominal.size * w**2 / G)
    flow = {"Surge": deep, "Sway": deep, "Heave": 1j * deep}
    per = [forces(s.nominal, w), forces(s.true, w), *(flow.get(d, 0 * w)[:, None] for d in s.nominal.dofs)]
    per, n = np.column_stack([np.ones(len(w)), *per]), s.nominal.n
    some = [np.exp(1j * np.outer(part, w)) @ (a[:, None] * height * per) for part in np.array_split(t.half, 20)]
    some = np.vstack(some) * ramp[:, None]
    t.envelope, some = abs(some[:, 0]), some.real
    t.eta, t.known, t.force, t.water = some[:, 0], some[:, 1 : n + 1], some[:, n + 1 : 2 * n + 1], some[:, 2 * n + 1 :]
    t.show, t.period = set(show), T
    t.cut = T * rng.uniform(4, 12) if rng.random() < 0.4 else 0.0
    return t


def forced(s: Setup, rng: np.random.Generator, dof: int, part: float) -> Test:
    """Return a chirp, a sum of sines or one sine of an actuator's force on one degree of freedom."""
    T, wn = 2 * np.pi / s.natural[dof], s.natural[dof]
    t = s.blank("forced", T * rng.uniform(25, 60))
    form, time, end = rng.choice(["chirp", "sines", "sines"]), t.half, t.span
    if form == "chirp":
        f0, f1 = wn * rng.uniform(0.4, 0.7), wn * rng.uniform(1.3, 1.9)
        signal, w = np.sin(f0 * time + (f1 - f0) * time**2 / (2 * end)), np.linspace(f0, f1, 20)
        height = 1 / abs(s.response(w)[:, dof, dof]).max()
    else:
        w = wn * np.sort(rng.uniform(0.45, 1.7, rng.integers(3, 9)))
        signal = np.cos(np.outer(time, w) + 2 * np.pi * rng.random(len(w))).sum(axis=1)
        height = 1 / np.sqrt(2 * np.sum(abs(s.response(w)[:, dof, dof]) ** 2))
    signal *= np.clip(time / (2 * T), 0, 1)
    t.known = np.zeros_like(t.known)
    t.known[:, dof] = part * height * s.lively[dof] * signal
    t.force, t.show, t.period = t.known * s.actuator, {"force"}, T
    return t


def prescribed(s: Setup, rng: np.random.Generator, dof: int, part: float) -> Test:
    """Return motion set by a machine, from rest; the force it takes is measured."""
    T = 2 * np.pi / s.natural[dof]
    t = s.blank("prescribed", T * rng.uniform(12, 30))
    w = s.natural[dof] * rng.uniform(0.4, 1.8, rng.integers(1, 5))
    time, fine = np.arange(8 * t.steps + 1) * s.h / 8, s.h / 8
    ramp, phase = np.clip(time / (1.5 * T), 0, 1), 2 * np.pi * rng.random(len(w))
    window = ramp**3 * (10 - 15 * ramp + 6 * ramp**2)
    x = np.zeros((len(time), s.nominal.n))
    x[:, dof] = part * s.lively[dof] / len(w) ** 0.5 * window * np.sin(np.outer(time, w) + phase).sum(axis=1)
    v = np.gradient(x, fine, axis=0, edge_order=2)
    a = np.gradient(v, fine, axis=0, edge_order=2)
    t.guide, t.show, t.period = (x[::8], v[::8], a[::8]), {"force"}, T
    return t


def static(s: Setup, rng: np.random.Generator, dof: int, part: float) -> Test:
    """Return a pull so slow that the body stands where the force holds it, to one side and the other."""
    T = 2 * np.pi / s.natural[dof]
    t = s.blank("static", T * rng.uniform(50, 80))
    t.known = np.zeros_like(t.known)
    t.known[:, dof] = part * s.lively[dof] * s.nominal.C[dof, dof] * np.sin(2 * np.pi * t.half / t.span)
    t.force, t.show, t.period = t.known * s.actuator, {"force"}, 4 * T
    return t


def programme(s: Setup, rng: np.random.Generator) -> tuple[str, list[Test], list[Test]]:
    """Return the name of a test programme, its records, and withheld ones."""
    kind, seen, unseen = chosen(s, rng)
    for test in seen + unseen:
        test.seed = int(rng.integers(2**31))
    return kind, seen, unseen


def chosen(s: Setup, rng: np.random.Generator) -> tuple[str, list[Test], list[Test]]:
    """Return what `programme` does, without seeds."""
    n = s.nominal.n
    main = int(rng.integers(n))
    kind = str(rng.choice(["decays", "decay+sea", "seas", "elevation", "forced", "regular", "prescribed", "static+"],
                          p=[0.17, 0.24, 0.12, 0.15, 0.12, 0.08, 0.05, 0.07]))
    eta = {"force", "eta"} if rng.random() < 0.65 else {"force"}
    waves = {"eta"} if kind == "elevation" else eta
    level = float(rng.uniform(0.5, 1.2))

    def part() -> float:
        return level * float(rng.uniform(0.4, 1.1))

    def dec(dof=None, speed=None):
        return decay(s, rng, int(rng.integers(n)) if dof is None else dof, part(), speed)

    def wav(regular=False):
        return sea(s, rng, main, part(), waves, regular)

    if kind == "decays":
        at_speed = rng.random() < 0.3
        root = np.sqrt(G * s.nominal.size)
        speeds = [round(float(u), 3) for u in root * np.array([0, 0.4, 0.8, 0.6])] if at_speed else [None] * 4
        seen = [dec(main, u) for u in speeds[: int(rng.integers(3, 5))]]
        seen += [dec(d, speeds[-1]) for d in range(n) if d != main]
        return kind, seen, [dec(main, speeds[1])]
    if kind == "forced":
        seen = [forced(s, rng, main, part()) for _ in range(rng.integers(1, 4))]
        return kind, [*seen, dec(main)], [forced(s, rng, main, part())]
    if kind == "prescribed":
        seen = [prescribed(s, rng, main, part()) for _ in range(rng.integers(2, 5))]
        return kind, seen, [prescribed(s, rng, main, part())]
    if kind == "regular":
        return kind, [wav(True) for _ in range(rng.integers(3, 6))] + [dec(main)], [wav(True)]
    seen = [wav() for _ in range(rng.integers(1, 4) + (kind == "seas"))]
    if kind in ("decay+sea", "static+") or (kind == "elevation" and rng.random() < 0.5):
        seen = [dec(main) for _ in range(rng.integers(1, 3))] + seen[:2]
    if kind == "static+":
        seen.append(static(s, rng, main, part()))
    return kind, seen, [wav() for _ in range(rng.integers(1, 3))]
