"""What a gap means for a given controller: nu-gap from the model to the corrected model, margin before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray
from radiation_ss.body.composite import cummins, signal_names
from radiation_ss.body.gap_metric import gap_metric, robust_margin
from radiation_ss.body.model import Model
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.errors import InputError
from radiation_ss.simulation.corrected import Corrected
from radiation_ss.simulation.linearised import linearise

if TYPE_CHECKING:
    import control as ct


@dataclass(frozen=True)
class ControlGap:
    """A controller on the model as given and on the corrected one.

    Parameters
    ----------
    nu_gap : float
        Vinnicombe's gap between the two plants, 0 to 1.
    margin_before, margin_after : float
        b(P, C) of the model as given and of the corrected one; 0 where the loop is unstable.
    measured : tuple of str
        Outputs that the controller is fed.
    left_out : tuple of str
        Effects that no linear plant holds.
    """

    nu_gap: float
    margin_before: float
    margin_after: float
    measured: tuple[str, ...]
    left_out: tuple[str, ...] = ()

    @property
    def guaranteed(self) -> bool:
        """Whether the margin on the model as given vouches for the corrected plant: b(P, C) > nu-gap."""
        return self.margin_before > self.nu_gap

    @property
    def sentence(self) -> str:
        """The meaning in one sentence."""
        if self.margin_before == 0.0:
            return "The controller does not stabilise the model as given."
        if self.margin_after == 0.0:
            return "The controller stabilises the model as given but not the corrected one."
        promise = ("the design on the model as given vouches for the corrected one" if self.guaranteed else
                   "the design on the model as given does not vouch for the corrected one, stable all the same")
        return (f"nu-gap {self.nu_gap:.3f} against a margin of {self.margin_before:.3f}: {promise}; its margin is "
                f"{self.margin_after:.3f}.")

    def to_dict(self) -> dict[str, Any]:
        """Return the fields for report.json."""
        return {**asdict(self), "guaranteed": self.guaranteed, "sentence": self.sentence}


def control_gap(model: Model, corrected: Corrected, controller: ct.StateSpace | ct.TransferFunction | ArrayLike,
                measured: Sequence[str] | None = None, *, amplitude: Mapping[str, float] | float | None = None,
                input_scale: ArrayLike | None = None, output_scale: ArrayLike | None = None) -> ControlGap:
    """Weigh a correction by what it does to a negative feedback u = -C y from motion to force.

    Parameters
    ----------
    model : Model
    corrected : Corrected
    controller : control.StateSpace, control.TransferFunction or array_like
        From `measured` to a force on every degree of freedom; a matrix is a gain.
    measured : sequence of str, optional
        Names of outputs of `cummins`: `heave`, `heave_vel`, `heave_acc`. All displacements by default.
    amplitude : mapping of dof to float, or float, optional
        Of the motion at which nonlinear effects are linearised [m or rad]; 0 is about rest. By default the records'.
    input_scale, output_scale : array_like, optional
        Units of force and motion, as in `gap_metric`. By default a harmonic motion at the natural frequency and the
        larger of the spring and the inertia force that belong to it.

    Raises
    ------
    InputError
        If an output is unknown or the controller's size does not fit.
    """
    _, outputs = signal_names(model.dofs)
    chosen = tuple(outputs[: model.n]) if measured is None else tuple(measured)
    unknown = [name for name in chosen if name not in outputs]
    if unknown:
        raise InputError(f"measured: {unknown[0]!r} is not an output of the model; use {', '.join(outputs)}")
    rows = [outputs.index(name) for name in chosen]
    force, motion = units(model)
    scale = {"input_scale": force if input_scale is None else input_scale,
             "output_scale": motion[rows] if output_scale is None else output_scale}
    before, after = (picked(plant, rows) for plant in (cummins(model), corrected.to_ss(model, amplitude)))
    left_out = linearise(model, corrected, amplitude).left_out
    return ControlGap(gap_metric(before, after, **scale), robust_margin(before, controller, **scale),
                      robust_margin(after, controller, **scale), chosen, left_out)


def picked(plant: ct.StateSpace, rows: Sequence[int]) -> ct.StateSpace:
    """Return a plant with some of its outputs."""
    import control as ct

    return ct.ss(plant.A, plant.B, plant.C[rows], plant.D[rows])


def units(model: Model) -> tuple[FloatArray, FloatArray]:
    """Return the scale of each force and of each output, for displacements of 1 m or 1 rad."""
    omega = np.array([natural_frequency(model, i) for i in range(model.n)])
    force = np.maximum(np.diag(model.C), omega**2 * np.diag(model.M + model.A_inf))
    return force, np.concatenate([omega**k for k in range(3)])
