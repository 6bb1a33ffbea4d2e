"""Bodies at any size from the tables: what the nominal model says, what the true body is, and its memory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

G = 9.81
ROTATIONS = ("Roll", "Pitch", "Yaw")


@dataclass(frozen=True)
class Body:
    """Linear coefficients of a floating body, SI, e^{+i w t}; X is for one heading, shape (nw, n)."""

    dofs: tuple
    omega: np.ndarray
    A: np.ndarray
    B: np.ndarray
    A_inf: np.ndarray
    X: np.ndarray
    M: np.ndarray
    C: np.ndarray
    D: np.ndarray
    heading: float
    rho: float
    depth: float
    zg: float
    size: float

    @property
    def n(self) -> int:
        return len(self.dofs)

    def natural(self) -> np.ndarray:
        """Return the uncoupled natural frequencies [rad/s], w^2 = C / (M + A(w))."""
        w = np.sqrt(np.diag(self.C) / np.diag(self.M + self.A_inf))
        for _ in range(50):
            A = np.array([np.interp(w[i], self.omega, self.A[:, i, i]) for i in range(self.n)])
            w = 0.5 * w + 0.5 * np.sqrt(np.diag(self.C) / (np.diag(self.M) + A))
        return w

    def damping_ratio(self) -> np.ndarray:
        """Return (B(w_n) + D) / (2 w_n (M + A)) of each degree of freedom."""
        w = self.natural()
        B = np.array([np.interp(w[i], self.omega, self.B[:, i, i], left=0.0) for i in range(self.n)])
        return (B + np.diag(self.D)) / (2 * np.diag(self.C) / w)


def load(path: Path, dofs: tuple, heading: int, size: float, rho: float) -> Body:
    """Read a table and scale it by Froude's law: omega ~ size^-1/2, force ~ rho size^3, rotations one more length.

    A panel mesh too coarse for infinite frequency gives an A_inf that its own A and B deny; theirs is taken (up to 2 %).
    """
    t = np.load(path)
    at = [list(t["dofs"]).index(d) for d in dofs]
    pick = np.ix_(at, at)
    arm = size ** np.array([1.0 if d in ROTATIONS else 0.0 for d in dofs])
    both, r = np.outer(arm, arm), rho / 1000.0
    body = Body(tuple(dofs), t["omega"] / size**0.5, t["A"][(slice(None), *pick)] * both * size**3 * r,
                t["B"][(slice(None), *pick)] * both * size**2.5 * r, t["A_inf"][pick] * both * size**3 * r,
                t["X"][:, min(heading, t["X"].shape[1] - 1)][:, at] * arm * size**2 * r, t["M"][pick] * both * size**3 * r,
                t["C"][pick] * both * size**2 * r, np.zeros((len(at), len(at))),
                float(t["directions"][min(heading, len(t["directions"]) - 1)]), rho,
                float(t["depth"]) * size if "depth" in t else np.inf, float(t["zg"]) * size, size)
    return replace(body, A_inf=body.A_inf - np.diag(tail(body)[1]))


def moored(body: Body, rng: np.random.Generator) -> Body:
    """Add soft springs to horizontal motions, and to what has hardly any damping a linear damping known to the model."""
    C, D = body.C.copy(), body.D.copy()
    C[abs(C) < 1e-9 * np.sqrt(abs(np.outer(np.diag(C), np.diag(C)))).max()] = 0.0
    C = (C + C.T) / 2
    slow = body.omega[-1] / rng.uniform(16, 30)
    for i, d in enumerate(body.dofs):
        if d in ("Surge", "Sway"):
            C[i, i] = slow**2 * (body.M[i, i] + body.A[0, i, i])
    body = replace(body, C=C)
    for i, (zeta, w) in enumerate(zip(body.damping_ratio(), body.natural())):
        least = rng.uniform(0.015, 0.04)
        if zeta < least:
            D[i, i] = 2 * (least - zeta) * C[i, i] / w
    return replace(body, D=D)


def perturbed(body: Body, rng: np.random.Generator, sd: float, radiation: float | None = None) -> Body:
    """Return the true body: mass, stiffness, A_inf, kernel and force off by `sd` (radiation: sd of the last three)."""
    rad = sd if radiation is None else radiation

    def off(matrix: np.ndarray, s: float) -> np.ndarray:
        root = np.sqrt(1 + np.clip(s * rng.standard_normal(body.n), -2.5 * s, 2.5 * s))
        return matrix * np.outer(root, root)

    tilt = np.tanh(np.log(body.omega / np.median(body.omega)))
    shape = 1 + rad * np.clip(rng.standard_normal() + 0.7 * tilt * rng.standard_normal(), -2.5, 2.5)
    gain = (1 + rad * rng.standard_normal(body.n)) * np.exp(0.5j * rad * rng.standard_normal(body.n))
    return replace(body, M=off(body.M, sd), C=off(body.C, sd), D=off(body.D, sd), A_inf=off(body.A_inf, rad),
                   B=body.B * shape[:, None, None], X=body.X * gain)


def difference(one: Body, other: Body) -> float:
    """Return how far two tables of a body are apart, relative: the worst of A_inf, B and X, diagonal, rms over frequency."""
    worst = 0.0
    for i in range(one.n):
        worst = max(worst, abs(one.A_inf[i, i] / other.A_inf[i, i] - 1))
        for a, b in ((one.B[:, i, i], other.B[:, i, i]), (one.X[:, i], other.X[:, i])):
            worst = max(worst, np.sqrt(np.mean(abs(a - b) ** 2) / np.mean(abs(a) ** 2)))
    return worst


def toward(mine: Body, other: Body, most: float) -> tuple[Body, float]:
    """Return my body with coefficients from another mesh or method, and how far they are apart.

    Where they are further apart than `most`, only part of the way is gone, the part that gives `most`.
    """
    def at(values: np.ndarray) -> np.ndarray:
        return CubicSpline(other.omega, values)(np.clip(mine.omega, other.omega[0], other.omega[-1]))

    theirs = replace(mine, A=at(other.A), B=at(other.B), A_inf=other.A_inf, X=at(other.X))
    apart = difference(mine, theirs)
    part = min(1.0, most / apart)
    mixed = {k: (1 - part) * getattr(mine, k) + part * getattr(theirs, k) for k in ("A", "B", "A_inf", "X")}
    return replace(mine, **mixed), apart * part


def tail(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Return how steeply each damping falls beyond the table, B ~ w^-p, and the mean error of A that remains.

    Both as A(w) - A_inf = -1/w int K sin(w t) dt asks (Ogilvie 1964).
    """
    w, tries, best, rest = body.omega, (1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 9.0), [], []
    n, step = 4000, 4 * body.omega[-1] / 4000
    v = (np.arange(n) + 0.5) * step
    # A - A_inf = 2/pi int (B(v) - B(w)) / (v^2 - w^2) dv (Kramers, Kronig), less what the cut leaves of B(w)
    pole = 1 / (v**2 - w[:, None] ** 2)
    over = np.log((v[-1] + step / 2 + w) / (v[-1] + step / 2 - w)) / (2 * w)
    for i in range(body.n):
        inside = PchipInterpolator(np.append(0, w), np.append(0, body.B[:, i, i]))(np.minimum(v, w[-1]))
        misses = []
        for p in tries:
            B = inside * np.minimum(1, w[-1] / v) ** p
            A = 2 / np.pi * (np.sum((B - body.B[:, i, i, None]) * pole, axis=1) * step - over * body.B[:, i, i])
            misses.append((A + body.A_inf[i, i] - body.A[:, i, i])[1:-1])
        k = int(np.argmin([np.mean(m**2) for m in misses]))
        best.append(tries[k])
        rest.append(np.mean(misses[k][w[1:-1] < 0.6 * w[-1]]))
    return np.array(best), np.array(rest)


def fine_damping(body: Body, top: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return damping on n even frequencies from 0 to `top`: shape-preserving splines, beyond the table a power tail."""
    w = np.linspace(0, top, n)
    given = np.concatenate([[0.0], body.omega])
    B = PchipInterpolator(given, np.concatenate([np.zeros((1, body.n, body.n)), body.B]))(np.minimum(w, given[-1]))
    fall = np.minimum(1.0, given[-1] / np.maximum(w, given[-1]))[:, None] ** (tail(body)[0] / 2)
    return w, B * fall[:, :, None] * fall[:, None, :]


def kernel(body: Body, step: float, longest: float) -> np.ndarray:
    """Return K(t) = 2/pi int B(w) cos(w t) dw (Ogilvie 1964) at multiples of `step`, cut where it has died away.

    The frequencies are so close together that the sum repeats itself only after four times `longest`.
    """
    t = np.arange(0, longest, step)
    top = 4 * body.omega[-1]
    w, B = fine_damping(body, top, max(1500, int(4 * longest * top / (2 * np.pi))))
    weight = np.full(len(w), w[1])
    weight[[0, -1]] /= 2
    flat = (B * weight[:, None, None]).reshape(len(w), -1)
    K = np.vstack([np.cos(np.outer(part, w)) @ flat for part in np.array_split(t, 1 + len(t) // 400)])
    K = (2 / np.pi * K).reshape(len(t), body.n, body.n)
    scale = np.sqrt(np.outer(*[np.diag(K[0])] * 2))
    big = np.nonzero((abs(K) / scale).max(axis=(1, 2)) > 4e-4)[0]
    last = min(len(t) - 1, big[-1] + 2)
    return K[: last + 1] * np.minimum(1.0, np.arange(last, -1, -1) / (0.1 * last))[:, None, None]


def forces(body: Body, omega: np.ndarray) -> np.ndarray:
    """Return the exciting force per metre at these frequencies of the table's range, shape (nw, n), by cubic splines."""
    return CubicSpline(body.omega, body.X)(np.clip(omega, body.omega[0], body.omega[-1]))


def write(body: Body, path: Path) -> None:
    """Write the nominal model as a Capytaine dataset."""
    import radiation_ss as rss

    data = rss.HydroData(body.omega, body.A, body.B, body.A_inf, body.dofs, rho=body.rho, g=G, depth=body.depth, M=body.M,
                         C=body.C, D=body.D, X=body.X[:, None, :], directions=np.array([body.heading]),
                         reference_point=(0.0, 0.0, body.zg), source="test tank")
    rss.write_hydro(data, path)
