"""Identification of coefficients, force and sea, each method with its bands."""
