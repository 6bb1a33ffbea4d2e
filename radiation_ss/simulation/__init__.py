"""Time-domain simulation: motion of a model with effects, its linear forms, and whether a record goes with a model."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "start": "step_size",
    "compiled": "CODES Compiled OPERATIONS",
    "corrected": "Corrected equivalent linearise",
    "corrected_files": "predict_record read_corrected",
    "driven": "equilibrium prescribed_force",
    "ensemble": "EnsembleMotion simulate_ensemble",
    "equations": "MotionEquations",
    "force_checks": "turned TurnRules",
    "headings": "along_waves force_of_waves heading",
    "linear": "exact_step Kernel left_over linear_response propagate",
    "measured": "coarse_excitation drifting mean_frequency measured_driven measured_freely unsure_edge",
    "native": "nonlinear_system signals_of state_equations",
    "prepared": "exciting_force half_steps prepare wave_force",
    "misreadings": "other_readings",
    "pushes": "let_go PushRules",
    "rollout": "interpolate Motion Rollout",
    "run": "run_in_steps simulate",
    "spikes": "SpikeRules without_spikes without_spikes_of_force",
    "unit_checks": "check_decays check_units doubts memory_length",
})
