"""Parameters and priors, noise, likelihood."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "kalman": "innovations log_likelihood",
    "laplace": "find_peak sample Target",
    "local_cosine": "blocks smooth",
    "own": "Own",
    "parameters": "parametrise",
    "points": "point_values",
    "regression": "Columns gains learn Rows size_gradient Sizes solve",
    "scales": "channels scales_of",
    "subsystems": "Subsystems subsystems_of",
})
