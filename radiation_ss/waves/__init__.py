"""Sea spectra, random-phase realisations, exciting force."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "dispersion": "group_speed wave_numbers",
    "force": "cosine_spreading energy_outside transfer",
    "realise": "harmonic_sum Sea",
    "spectrum": "jonswap_density",
})
