"""What records can tell apart, before any fit; which tests to make."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {"gap_metric": "hinf_norm"})
