"""Parameters and priors, noise, likelihood."""
