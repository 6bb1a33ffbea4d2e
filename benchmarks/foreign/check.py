"""Checks of the truth simulators: python check.py BEM_FOLDER prints one table."""

import sys
from pathlib import Path

import numpy as np
import truth


def error(p, q, i):
    return 100 * np.linalg.norm((p - q)[:, i]) / np.linalg.norm(q[:, i])


def main(folder):
    print("body            A(w)-KK%  conv-lin decay%  halving%  prony fit%  prony-conv%  FD amp%  energy%")
    for path in sorted(Path(folder).glob("*.nc")):
        body = truth.rig(truth.load(path), 1e9)
        body = truth.rig(body, 50 * np.sqrt(body.M[0, 0] / 1e3) ** (1 / 3))
        n = len(body.dofs)
        natural = np.sqrt(np.diag(body.stiffness) / np.diag(body.M + body.A_inf))
        w0 = natural[natural > 0].max()
        dt = 2 * np.pi / w0 / 160
        t = np.arange(0, 20 * 2 * np.pi / w0, dt)
        K = body.kernel(dt, 60.0 / body.omega[-1] * 3.2)
        tk = np.arange(len(K)) * dt
        pick = np.arange(3, len(body.omega) - 15, 4)
        kk = np.array(
            [body.A_inf - np.trapezoid(K * np.sin(w * tk)[:, None, None], dx=dt, axis=0) / w for w in body.omega[pick]]
        )
        scale = np.diag(body.M + body.A_inf)
        e_kk = np.max(np.abs(np.einsum("wii->wi", kk - body.A[pick])) / scale)
        x0 = np.where(natural > 0.2 * w0, 0.05, 0.0)
        none = truth.Effects(n)
        zero = np.zeros((t.size, n))
        x = truth.convolve(body, none, dt, zero, x0)[0]
        lin = truth.linear(body, dt, zero, x0)
        fx = truth.Effects(n)
        i = int(np.argmax(natural))
        c = 0.1 * w0 * (body.M + body.A_inf)[i, i]
        fx.put(
            i,
            quadratic_drag=2 * c / (w0 * 0.05),
            coulomb_friction=0.02 * c * w0 * 0.05,
            coulomb_speed=0.03 * w0 * 0.05,
            cubic_stiffness=20 * body.stiffness[i, i],
        )
        one = truth.convolve(body, fx, dt, zero, x0)[0]
        two = truth.convolve(body, fx, dt / 2, np.zeros((2 * t.size, n)), x0)[0][::2][: t.size]
        modal, _, _, e_fit = truth.prony(body, fx, dt, zero, x0)
        w = np.array([0.8 * w0])
        _, force = truth.excitation(body, w, np.array([0.02]), np.zeros(1), t)
        damp = truth.Effects(n)
        damped = 0.2 * w0 * np.diag(body.M + body.A_inf)
        damp.table[:, 0] = damped
        regular = truth.convolve(body, damp, dt, force * truth.ramp(t, 5 * 2 * np.pi / w0)[:, None])[0]
        A, B = (
            np.array([np.interp(w[0], body.omega, part[:, a, b]) for a in range(n) for b in range(n)]).reshape(n, n)
            for part in (body.A, body.B)
        )
        Xc = np.array(
            [
                np.interp(w[0], body.omega, body.X[:, a].real) + 1j * np.interp(w[0], body.omega, body.X[:, a].imag)
                for a in range(n)
            ]
        )
        rao = (
            np.abs(
                np.linalg.solve(
                    body.stiffness - w[0] ** 2 * (body.M + A) - 1j * w[0] * (B + np.diag(body.D + damped)), Xc
                )
            )
            * 0.02
        )
        last = t > t[-1] - 3 * 2 * np.pi / w[0]
        measured = np.abs(2 / last.sum() * regular[last].T @ np.exp(1j * w[0] * t[last]))
        x, v, _ = truth.convolve(body, none, dt, zero, x0)
        memory = np.array(
            [
                dt * sum(K[k] @ v[m - k] for k in range(1, min(m, len(K) - 1) + 1))
                + 0.5 * dt * K[0] @ v[m]
                + body.D * v[m]
                for m in range(t.size)
            ]
        )
        H = 0.5 * np.einsum("ti,ij,tj->t", v, body.M + body.A_inf, v) + 0.5 * np.einsum(
            "ti,ij,tj->t", x, body.stiffness, x
        )
        lost = np.r_[0, np.cumsum(0.5 * dt * ((memory * v).sum(1)[1:] + (memory * v).sum(1)[:-1]))]
        off, energy = np.max(np.abs(measured / rao - 1)[i]), np.max(np.abs(H + lost - H[0])) / H[0]
        print(
            f"{path.stem:14s} {100 * e_kk:8.2f} {error(x, lin, i):12.3f} {error(one, two, i):12.3f} "
            f"{100 * e_fit:10.3f} {error(modal, two, i):11.3f} {100 * off:9.2f} {100 * energy:9.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1])
