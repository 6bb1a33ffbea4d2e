"""The withheld check: sealed cases from a generator that shares no formula with the diagnosis."""

from radiation_ss.blind.runner import generate, run
from radiation_ss.blind.scoring import score

__all__ = ["generate", "run", "score"]
