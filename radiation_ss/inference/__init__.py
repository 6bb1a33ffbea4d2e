"""Parameters and priors, noise, likelihood."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "effect_features": "features",
    "effect_symbols": "Symbols",
    "candidates": "terms_of unseen_strengths",
    "equation": "equation_error",
    "motion_rows": "compliance",
    "kalman": "innovations log_likelihood",
    "laplace": "find_peak sample Target",
    "linear_model": "Columns Rows Sizes bounded_step joined",
    "local_cosine": "blocks projected_on smooth",
    "force_errors": "narrow_resonance noise_at_resonance",
    "motion": "measured_motion parted",
    "own": "Own",
    "points": "point_values",
    "prior": "parametrise",
    "regression": "learn size_slopes solve",
    "rows": "force_noise",
    "score": "gains",
    "scales": "channels scales_of",
    "subsystems": "Subsystems subsystems_of",
})
