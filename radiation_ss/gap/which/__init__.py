"""Which effect: score test, refits, evidence, what chance reaches, and the verdict."""
