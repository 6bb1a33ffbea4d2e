"""The same scores for anybody's radiation model."""

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.fit.certificate import Certificate, certify
from radiation_ss.fit.files import foreign, read_fit
from radiation_ss.fit.problem import entry_errors, joint_error, scales
from radiation_ss.fit.rational import frequency_response
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData, mode, signal
from radiation_ss.hydro.files import as_data
from radiation_ss.methods import Brief

if TYPE_CHECKING:
    import control as ct

NAMELESS = re.compile(r"u\[\d+\]")     # python-control's own names of inputs
NO_BODY = re.compile(r"^body\d+_")     # what readers call the bodies of files that name none


@dataclass(frozen=True, eq=False, repr=False)
class Audit(Brief):
    """Scores of a radiation model against data."""

    name: str
    dofs: tuple[str, ...]  # Degrees of freedom of the data that were compared
    states: int
    certificate: Certificate  # Of the model as a matrix
    # ||K - K_model|| / ||K|| over all samples and entries, scaled (`radiation_ss.fit.problem.joint_error`)
    relative_error: float
    entry_error: FloatArray  # (n, n): The same for each entry; NaN where the data are zero or numerical noise
    asymmetry: float  # Largest |K_ij - K_ji| of the model, scaled, relative to the largest |K_ij|: reciprocity
    # Smallest eigenvalue of the damping in the data, scaled, relative to the largest in size: what the data themselves
    # are
    data_margin: float
    # `relative_error` of minus the model: small where its output is the force on the body, -K times velocity.
    opposite_error: float

    @property
    def stable(self) -> bool:
        """All poles in the open left half plane."""
        return self.certificate.stable

    @property
    def passive(self) -> bool:
        """Positive real as a matrix."""
        return self.certificate.passive

    @property
    def diagonal_error(self) -> float:
        """Median of the diagonal entries' errors."""
        return float(np.nanmedian(np.diag(self.entry_error)))

    def to_dict(self) -> dict[str, Any]:
        """Return the scores as plain numbers, ready for JSON."""
        finite = [[None if np.isnan(v) else float(v) for v in row] for row in self.entry_error]
        return {"name": self.name, "dofs": list(self.dofs), "states": self.states, "stable": self.stable,
                "passive": self.passive, "passivity_margin": self.certificate.margin,
                "worst_omega": None if np.isinf(self.certificate.worst_omega) else self.certificate.worst_omega,
                "relative_error": self.relative_error, "diagonal_error": self.diagonal_error,
                "entry_error": finite, "asymmetry": self.asymmetry, "data_margin": self.data_margin,
                "opposite_error": self.opposite_error}

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.states} states, {self.certificate}",
                 f"  error over all entries {self.relative_error:.3f}, median of the diagonal "
                 f"{self.diagonal_error:.3f}, asymmetry {self.asymmetry:.1e}",
                 f"  the data themselves: smallest eigenvalue of the damping {self.data_margin:.1e} of the largest"]
        if self.opposite_error < min(self.relative_error, 0.5):  # nearer to the data than to no radiation
            lines.insert(1, f"  this looks like -K, whose output is the force on the body: with the other sign "
                            f"the error is {self.opposite_error:.3f}")
        worst = sorted((-error, dof) for error, dof in zip(np.diag(self.entry_error), self.dofs) if not np.isnan(error))
        lines += [f"  {dof}: {-error:.3f}" for error, dof in worst[:6]]
        return "\n".join(lines + ([f"  and {len(worst) - 6} more, smaller"] if len(worst) > 6 else []))


def audit(system: "RadiationFit | ct.StateSpace | ct.TransferFunction | Mapping[str, Any] | str | Path",
          data: HydroData) -> Audit:
    """Score a radiation model against data: error, stability, passivity as a matrix, reciprocity.

    Parameters
    ----------
    system : RadiationFit, ct.StateSpace, ct.TransferFunction, mapping or path
        From velocities to radiation force (the body feels minus it). Inputs named `<dof>_vel` are matched with the data
        by name; by position only where the model has no names, or names modes but no body. A mapping holds MSS's
        Ar_ij, Br_ij, Cr_ij in the axes of the data. A path is .json, OpenFAST .ss, BEMIO .h5, .mat or .npz.
    data : HydroData
        Without A_inf, the model's own is taken, else it is estimated.

    Returns
    -------
    Audit

    Raises
    ------
    InputError
        If the model's degrees of freedom are not the data's.

    Warns
    -----
    InputWarning
        If a model that names no body is compared with data that name one.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 30.0, 60), gyradius=0.07)
    >>> data = section.select("Heave").times(0.3)
    >>> report = rss.audit(rss.fit_radiation(data, 3), data)
    >>> report.passive
    True
    """
    data = as_data(data)
    if isinstance(system, str | Path):
        system = read_fit(system).replace(method=Path(system).name)
    name, dofs, (a, b, c), d = _matrices(system)
    pick, part = _matched(dofs, data)
    if part.A_inf is None:
        own = system.A_inf if isinstance(system, RadiationFit) else None
        part = part.with_A_inf() if own is None or len(pick) < len(dofs) else part.replace(A_inf=own)
    b, c, d = b[:, pick], c[pick], d[np.ix_(pick, pick)]
    K = frequency_response(a, b, c, part.omega) + d
    pairs = np.outer(scales(part), scales(part))
    scaled = K / pairs
    loud = np.isfinite(scales(part))
    damping = 0.5 * (part.B + np.swapaxes(part.B, 1, 2)) / pairs
    margins = np.linalg.eigvalsh(damping[:, loud][:, :, loud])
    return Audit(name, part.dofs, a.shape[0], certify(a, b, c, d), joint_error(part, K), entry_errors(part, K),
                 float(np.abs(scaled - np.swapaxes(scaled, 1, 2)).max() / max(np.abs(scaled).max(), 1e-300)),
                 float(margins.min() / max(np.abs(margins).max(), 1e-300)) if loud.any() else 0.0,
                 joint_error(part, -K))


def _matrices(system: Any) -> tuple[str, tuple[str, ...], tuple[FloatArray, FloatArray, FloatArray], FloatArray]:
    """Return (name, names of the degrees of freedom, (a, b, c), d) of any model."""
    if isinstance(system, Mapping):
        name, system = "MSS", foreign("from_arrays", ".npz")(system)
    else:
        name = str(getattr(system, "name", "") or getattr(system, "method", "model"))
    if isinstance(system, RadiationFit):
        n = len(system.dofs)
        return name, tuple(signal(dof) for dof in system.dofs), (system.a, system.b, system.c), np.zeros((n, n))
    system = _realised(system, name) if hasattr(system, "num_list") or hasattr(system, "num") else system
    matrices = [getattr(system, key, None) for key in "ABCD"]
    if any(matrix is None for matrix in matrices) or system.ninputs != system.noutputs:
        raise InputError(f"{name}: not a radiation model; a square ct.StateSpace, a RadiationFit, a file or MSS's "
                         "arrays are needed")
    if getattr(system, "dt", 0) not in (0, None):
        raise InputError(f"{name}: a discrete system (dt = {system.dt:g} s); the audit needs the continuous one")
    A, B, C, D = (np.asarray(matrix, dtype=float) for matrix in matrices)
    return name, tuple(label.removesuffix("_vel") for label in system.input_labels), (A, B, C), D


def _realised(system: "ct.TransferFunction", name: str) -> "ct.StateSpace":
    import control as ct

    try:
        return ct.ss(system, inputs=system.input_labels, outputs=system.output_labels)
    except Exception as error:  # scipy's and slycot's: improper, or several inputs without slycot
        raise InputError(f"{name}: no state space follows from this transfer function ({error}); give a proper one, "
                         "or a ct.StateSpace") from None


def _matched(dofs: tuple[str, ...], data: HydroData) -> tuple[list[int], HydroData]:
    names = [signal(dof) for dof in data.dofs]
    if shared := [dof for dof, name in zip(data.dofs, names) if name in dofs]:
        return [dofs.index(signal(dof)) for dof in shared], data.select(shared)
    lists = f"the model's are {', '.join(dofs)}, the data's {', '.join(data.dofs)}"
    if len(dofs) != data.n:
        raise InputError(f"the model has {len(dofs)} degrees of freedom, the data {data.n}, and no name is shared: "
                         f"{lists}")
    if all(NAMELESS.fullmatch(dof) for dof in dofs):
        return list(range(data.n)), data
    if [NO_BODY.sub("", dof) for dof in dofs] == [signal(mode(dof)) for dof in data.dofs]:
        warnings.warn(InputWarning(f"compared by position, because the model names no body: {lists}; "
                                   "are both of the same body?"), stacklevel=3)
        return list(range(data.n)), data
    raise InputError(f"no degree of freedom is shared, so this may be another body: {lists}; if they are the same, "
                     "give the data the model's names (dofs=...), or the model's inputs the data's (<dof>_vel)")
