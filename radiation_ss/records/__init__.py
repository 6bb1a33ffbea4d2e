"""Measured records: data, files, checks."""
