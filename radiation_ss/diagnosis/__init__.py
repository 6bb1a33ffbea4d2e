"""Diagnosis of the sim-to-real gap: where it is, which effects cause it, how far it shrinks."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "decision": "Grounds verdict",
    "diagnose": "contradiction",
    "left": "unit_of",
    "prediction": "Error",
    "result": "Named",
    "rules": "Rules",
    "sets": "alternatives",
    "shares": "budget Row shapley",
})
