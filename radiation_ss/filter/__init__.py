"""Identification of coefficients and wave force from motion."""
