"""Time-domain simulation: motion of a model with effects, its linear forms, and whether a record goes with a model."""

from importlib import import_module
from typing import Any

# Names of the room by module; loaded on first use, as casadi and numba take their time.
_MODULES = {"run": ("simulate", "predict_record"), "linear": ("linear_response", "exact_step", "propagate"),
            "driven": ("prescribed_force", "equilibrium"), "ensemble": ("simulate_ensemble", "EnsembleMotion"),
            "corrected": ("Corrected", "read_corrected"), "linearised": ("linearise", "equivalent"),
            "native": ("nonlinear_system", "state_equations"), "rollout": ("Rollout", "Motion"),
            "equations": ("MotionEquations",), "prepare": ("exciting_force", "wave_force", "half_steps"),
            "steps": ("step_size",), "measured": ("measured_freely", "released"),
            "unit_checks": ("check_units", "check_decays", "doubts", "memory_length"),
            "sign_checks": ("turned", "TurnRules"),
            "wave_reach": ("unsure_edge", "coarse_excitation", "mean_frequency")}
_NAMES = {name: module for module, names in _MODULES.items() for name in names}

__all__ = list(_NAMES)


def __getattr__(name: str) -> Any:
    if name not in _NAMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_NAMES[name]}"), name)
