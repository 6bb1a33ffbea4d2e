"""The withheld check: sealed cases from a generator that shares no formula with the diagnosis."""

from radiation_ss.methods import door

__getattr__, __all__ = door(__name__, {
    "worker": "carry_out predictions result_file unfinished",
    "seal": "MANIFEST open_seal read_run sealed_folder",
    "bodies": "BODIES heave Mode truth",
    "causes": "ALL candidates CAUSES draw Hidden",
    "experiments": "happen plans sensed wandering",
    "physics": "integrate LAWS",
    "runner": "generate make MIX mix_of run schedule",
    "scoring": "binomial_interval score Scored table",
    "strength": "BEYOND distance hide LARGEST left retunings TOLERANCE typical within",
})
