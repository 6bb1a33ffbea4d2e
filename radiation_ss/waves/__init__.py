"""Sea spectra, random-phase realisations, exciting force."""
