"""Radiation subsystems: constrained rational fits, certificate, order choice, audit."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "audit": "Audit",
    "certificate": "Certificate certify",
    "joint": "order_of",
    "port": "Port port_of",
    "problem": "block_problem",
    "program": "minimise misfit_of solved",
    "rational": "frequency_response impulse_response minimal modes observer_form to_polynomials",
})
