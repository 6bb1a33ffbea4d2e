"""The model under diagnosis as a least-squares problem: parameters, priors, noise, fits, evidence."""
