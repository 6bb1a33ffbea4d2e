"""Frequency-domain hydrodynamic coefficients: data, files, transforms, checks, the 2-D section solver."""
