"""The dual ensemble Kalman filter: the wave excitation force and the radiation parameters from motion."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "settings": "ForceModel",
    "bank": "PlantEstimate UncertainPlant",
    "checkpoint": "read_arrays write_arrays",
    "dual_enkf": "DualEnKF",
    "estimate": "Band Estimate StepResult",
    "kernels": "fill_gaussian fill_three_point rk4_single working_space",
    "members": "damping_slopes drawing exact_draws",
    "plan": "SampleBlock",
    "prior": "conditions Draws Evidence finish lognormal most_probable",
    "repeated": "FilterStudy repeat run_seed",
})
