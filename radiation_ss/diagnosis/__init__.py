"""Diagnosis of the sim-to-real gap: where it is, which effects cause it, how far it shrinks."""
