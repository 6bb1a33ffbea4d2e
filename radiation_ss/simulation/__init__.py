"""Time-domain simulation: motion of a model with effects, its linear forms, and whether a record goes with a model."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "start": "step_size",
    "compiled": "CODES Compiled OPERATIONS",
    "corrected": "Corrected read_corrected",
    "driven": "equilibrium prescribed_force",
    "ensemble": "EnsembleMotion simulate_ensemble",
    "equations": "MotionEquations signals_of state_equations",
    "integrator": "propagate_slopes",
    "linear": "exact_step linear_response propagate",
    "linearised": "equivalent linearise nonlinear_system",
    "measured": "drifting measured_freely SpikeRules without_spikes",
    "prepared": "exciting_force half_steps prepare wave_force",
    "reading": "interpolate",
    "rollout": "Motion Rollout",
    "run": "predict_record run_in_steps simulate",
    "sign_checks": "turned TurnRules",
    "unit_checks": "check_decays check_units doubts memory_length",
    "wave_reach": "coarse_excitation mean_frequency unsure_edge",
})
