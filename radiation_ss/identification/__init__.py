"""Identification of coefficients, force and sea, each method with its bands."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "banded": "Coefficients",
    "channels": "known_force motion_channels",
    "force": "ForceSpectra smooth_one total_deviation",
    "haskind": "relation",
    "motion_likelihood": "Law MotionLikelihood uncoupled",
    "motion_only": "climb",
    "passivity": "nearest_passive passive",
    "sea": "SeaModel",
    "spectral": "SpectralRules spectral_likelihood",
    "study": "cautious Settings Study",
})
