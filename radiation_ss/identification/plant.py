"""A Model out of a ct.StateSpace with the signals of `cummins`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import null_space

from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit

if TYPE_CHECKING:
    import control as ct


def model_of_system(system: ct.StateSpace) -> Model:
    """Return the model behind a continuous system in any state coordinates.

    Inputs `<dof>_force`; outputs `<dof>`, `<dof>_vel`, `<dof>_acc`, where `heave` is the record's Heave. Only mass plus
    A_inf can be told: it becomes M, with A_inf zero, so that A of an identification is that beyond A_inf.

    Raises
    ------
    InputError
        If the system is sampled, a signal is missing, or it is no floating body (force does not act on acceleration).
    """
    if system.isdtime(strict=True):
        raise InputError("system: a continuous-time ct.StateSpace is needed; give the plant before it is sampled")
    signals = [name.removesuffix("_force") for name in system.input_labels if name.endswith("_force")]
    wanted = [f"{signal}{end}" for end in ("", "_vel", "_acc") for signal in signals]
    missing = [name for name in wanted if name not in system.output_labels]
    if not signals or missing:
        raise InputError(f"system: signals as those of rss.cummins are needed; output {(missing or ['heave'])[0]!r} is "
                         f"missing among {list(system.output_labels)}, inputs {list(system.input_labels)}")
    dofs = tuple("__".join([*signal.split("__")[:-1], signal.split("__")[-1].capitalize()]) for signal in signals)
    n, inputs = len(dofs), [system.input_labels.index(f"{signal}_force") for signal in signals]
    rows = [system.output_labels.index(name) for name in wanted]
    rigid, G = system.C[rows[:2 * n]], system.D[np.ix_(rows[2 * n:], inputs)]
    if np.linalg.cond(G) > 1e12 or rigid.shape[1] <= 2 * n:
        raise InputError("system: force does not act on every acceleration, or there are no radiation states")
    T = np.vstack([null_space(rigid).T, rigid])
    A, B = T @ system.A @ np.linalg.inv(T), T @ system.B[:, inputs]
    m, inertia = A.shape[0] - 2 * n, np.linalg.inv(G)
    r, d, v = slice(0, m), slice(m, m + n), slice(m + n, m + 2 * n)
    # r = r' + P d + Q v, so that neither force nor displacement enters the radiation states r'.
    Q = B[r] @ inertia
    a = A[r, r] - Q @ A[v, r]
    P = -np.linalg.solve(a, A[r, d] - Q @ A[v, d])
    b = A[r, v] - Q @ A[v, v] + a @ Q - P
    stiffness = -inertia @ (A[v, d] + A[v, r] @ P)
    damping = -inertia @ (A[v, v] + A[v, r] @ Q)
    fit = RadiationFit(dofs, a, b, -inertia @ A[v, r], order=m, A_inf=np.zeros((n, n)))
    return Model(dofs, inertia, np.zeros((n, n)), stiffness, fit, D=damping, name=system.name or "system")
