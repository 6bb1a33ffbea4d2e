"""No matrix is singular, and no warning comes, in a diagnosis of special but healthy records."""

import numpy as np
import pytest
from degenerate_records import degenerate

import radiation_ss as rss

CASES = degenerate()


@pytest.mark.parametrize("name", ["at rest", "the same record twice", "rounded to two values", "a sensor that stands",
                                  "two sensors alike", "two modes that move alike", "masses nearly singular",
                                  "1e9 times too large", "1e-200", "no states"])
def test_a_diagnosis_ends_or_refuses(name):
    model, records = CASES[name]
    try:
        found = rss.diagnose(model, records, effects=["linear_damping", "quadratic_drag"])
    except rss.InputError as error:
        assert len(str(error)) < 1500 and "\n" not in str(error)
    else:
        chances = [c.probability for c in found.which]
        assert np.isfinite(chances).all() and 0.99 < sum(chances) < 1.01
        assert np.isfinite([row.share for row in found.budget.rows]).all()


@pytest.mark.parametrize("name", ["no radiation", "no states"])
def test_an_identification_without_radiation_ends_or_refuses(name):
    model, records = CASES[name]
    try:
        assert rss.identify(model, records).force
    except rss.RadiationError as error:
        assert "\n" not in str(error)
