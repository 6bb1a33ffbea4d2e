"""Radiation subsystems: constrained rational fits, certificate, order choice, audit."""
