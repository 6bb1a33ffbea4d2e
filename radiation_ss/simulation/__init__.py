"""Measured records, effects, and time-domain simulation."""
