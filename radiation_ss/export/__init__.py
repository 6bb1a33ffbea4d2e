"""Radiation and excitation models in the file forms of other tools."""
