"""Sea spectra, random-phase realisations, exciting force."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "force": "cosine_spreading energy_outside transfer",
    "realise": "harmonic_sum Sea",
    "spectrum": "jonswap_density",
})
