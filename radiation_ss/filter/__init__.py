"""The dual ensemble Kalman filter: the wave excitation force and the radiation parameters from motion."""

from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.filter.estimate import Band, Estimate, StepResult
from radiation_ss.filter.force_model import ForceModel
from radiation_ss.filter.general import PlantEstimate, UncertainPlant
from radiation_ss.filter.repeat import FilterStudy, repeat, run_seed

__all__ = ["Band", "DualEnKF", "Estimate", "FilterStudy", "ForceModel", "PlantEstimate", "StepResult",
           "UncertainPlant", "repeat", "run_seed"]
