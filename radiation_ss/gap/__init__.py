"""Diagnosis of the sim-to-real gap: where, which effect, how far it shrinks."""
