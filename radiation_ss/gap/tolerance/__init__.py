"""The fit without effects, free in all that the tolerances allow."""
