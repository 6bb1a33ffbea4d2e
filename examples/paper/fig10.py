"""Fig. 10: heave added mass and damping by the filter in three seas, beside the section solver's."""

import numpy as np
from tank import CASES, UNIT, figure, frequency, heave_model, options, printed, sail, wavenumber

import radiation_ss as rss
from radiation_ss.filter import FilterStudy


def main():
    model, runs = heave_model(), options().runs
    w, parts = np.linspace(2.0, frequency(4.0), 120), rss.DualEnKF(model).parts
    truth = np.interp(w, model.hydro.omega, model.hydro.K[:, 0, 0])
    near = (wavenumber(w) > 0.3) & (wavenumber(w) < 1.0)
    start = model.fit.frequency_response(w)[:, 0, 0]
    curves, rows = {"start": start}, []
    for case, t01 in CASES.items():
        record, _ = sail(model, t01)
        results = rss.repeat(FilterStudy(model, record, preset="paper", n_ensemble=100), runs, seed=10)
        curves[f"{case}, paper's filter"] = parts.K(results["theta"][~results["diverged"]].mean(axis=0), w)[:, 0, 0]
    record, _ = sail(model, CASES["Case-3"])
    curves["Case-3, default filter"] = rss.DualEnKF(model, omega=w).run(record).K[:, 0, 0]
    for name, K in curves.items():
        errors = [np.linalg.norm((K - truth)[part]) / np.linalg.norm(truth[part]) for part in (near, ~near)]
        rows.append([name, *errors])
    printed(rows, [f"error of K ({runs} runs)", "0.3 < K b < 1", "outside"])
    print("paper: good agreement with the forced oscillation test where the motion has power, drifting outside")

    def draw(axes):
        axes[0].plot(wavenumber(w), (model.A_inf[0, 0] + truth.imag / w) / (UNIT * 0.01), "k", label="section solver")
        axes[1].plot(wavenumber(w), truth.real / (UNIT * 0.01), "k")
        for name, K in curves.items():
            axes[0].plot(wavenumber(w), (model.A_inf[0, 0] + K.imag / w) / (UNIT * 0.01), "--", label=name)
            axes[1].plot(wavenumber(w), K.real / (UNIT * 0.01), "--")
        axes[0].set(xlabel="K b", ylabel="A33 / (rho b$^2$ L)")
        axes[1].set(xlabel="K b", ylabel="B33 / (rho b$^2$ L) [1/s]")
        axes[0].legend(fontsize=7)

    figure("fig10", draw, ncols=2, figsize=(8.0, 3.2))


if __name__ == "__main__":
    main()
