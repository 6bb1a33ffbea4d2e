"""Diagnosis of records with nothing but motion."""
