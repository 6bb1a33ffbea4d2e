"""Fig. 11: power spectrum of the heave motion in the three seas."""

import numpy as np
from scipy.signal import welch
from tank import CASES, figure, frequency, heave_model, printed, sail, wavenumber

PEAKS = {"Case-1": "0.5", "Case-2": "0.4", "Case-3": "0.4"}  # read from the paper's text


def main():
    model, spectra, rows = heave_model(), {}, []
    for case, t01 in CASES.items():
        record, _ = sail(model, t01, duration=600.0)
        f, power = welch(record.channels["Heave"], fs=100.0, nperseg=4096)
        w, S = 2.0 * np.pi * f[1:], power[1:] / (2.0 * np.pi)
        spectra[case] = (w, S)
        share = np.cumsum(S) / S.sum()
        low, high = (wavenumber(w[np.searchsorted(share, q)]) for q in (0.025, 0.975))
        rows.append([case, wavenumber(w[S.argmax()]), PEAKS[case], low, high])
    printed(rows, ["", "K b at the peak", "paper's", "2.5 % of the power below", "2.5 % above"])

    def draw(ax):
        for case, (w, S) in spectra.items():
            near = w < frequency(3.0)
            ax.plot(wavenumber(w[near]), 1e6 * S[near], label=f"{case}, T01 = {CASES[case]} s")
        ax.set(xlabel="K b", ylabel="S [mm$^2$ s]", xlim=(0, 1.5))
        ax.legend()

    figure("fig11", draw, figsize=(5.0, 3.0))


if __name__ == "__main__":
    main()
