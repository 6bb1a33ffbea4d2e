"""What the wave excitation force must be in long waves, whatever the body: a test of phases and headings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.data import body, mode

REVERSED = ("in long waves the horizontal wave force lags the elevation by a quarter period where it must lead: the "
            "phases are those of exp(-i w t) (then data.replace(X=data.X.conj())), or the headings are where waves "
            "come from (then directions + pi)")


def horizontal_lead(X: ComplexArray | None, C: FloatArray | None, dofs: Sequence[str], directions: FloatArray | None,
                    near: float = 0.3) -> float | None:
    """Return the angle [rad] by which horizontal forces lead heave's in long waves; None where that is not known.

    In long waves heave's force is the restoring force times the elevation, and the force along the waves is a mass of
    water times its acceleration, a quarter period earlier: pi / 2. The place of the body falls out.

    Parameters
    ----------
    X : array_like, shape (nw, n_dir, n), or None
    C : array_like, shape (n, n), or None
    dofs : sequence of str
    directions : array_like, shape (n_dir,), or None
        Where waves run to [rad].
    near : float
        Waves are long from the lowest frequency up to where heave's force first departs from its restoring force by
        this share. (At higher frequencies a spar or semisubmersible has that force again, with the other sign.)
    """
    if X is None or C is None or directions is None:
        return None
    places = {dof: k for k, dof in enumerate(dofs)}
    total = 0.0 + 0.0j
    for dof, k in places.items():
        if mode(dof) != "Heave" or not C[k, k] > 0.0:
            continue
        departed = np.abs(np.abs(X[:, :, k]) / C[k, k] - 1.0).max(axis=1) >= near
        long = ~np.logical_or.accumulate(departed)
        for name, along in (("Surge", np.cos(directions)), ("Sway", np.sin(directions))):
            other = places.get(f"{body(dof)}__{name}" if body(dof) else name)
            if other is not None:
                total += (X[long, :, other] * X[long, :, k].conj() * along).sum()
    return float(np.angle(total)) if total else None


def is_reversed(lead: float | None) -> bool:
    """Return whether the horizontal force lags by about a quarter period."""
    return lead is not None and abs(lead + np.pi / 2.0) < np.pi / 4.0
