"""Fig. 4: heave added mass and damping by the section solver, and from the fitted subsystem of order 3."""

import numpy as np
from tank import TABLE_3, UNIT, figure, heave_model, printed, wavenumber

from radiation_ss.inference.subsystems import Subsystems


def main():
    model = heave_model()
    data, w = model.hydro, model.hydro.omega
    K, fitted = data.K[:, 0, 0], model.fit.frequency_response(w)[:, 0, 0]
    paper = Subsystems(("Heave",), ((0, 0),), (3,), np.array(TABLE_3["2D-BEM"]) * np.repeat([1.0, UNIT], 3))
    row = paper.K(paper.theta, w)[:, 0, 0]
    size, band = np.linalg.norm(K), wavenumber(w) < 3.0
    printed([["our fit against our section solver", np.linalg.norm(fitted - K) / size, "'good agreement'"],
             ["paper's 2D-BEM row against our section solver", np.linalg.norm(row - K) / size, "-"],
             ["the same, K b < 3", np.linalg.norm((row - K)[band]) / np.linalg.norm(K[band]), "-"],
             ["A_inf / (rho b^2 L)", data.A_inf[0, 0] / (UNIT * 0.01), "-"],
             ["K(0) / (rho b^2 L) [1/s]", model.fit.frequency_response([0.0])[0, 0, 0].real / (UNIT * 0.01),
              f"{TABLE_3['2D-BEM'][3] / TABLE_3['2D-BEM'][0] / 0.01:.4g}"]], ["", "ours", "paper"])

    def draw(axes):
        for ax, ours, fit, unit in ((axes[0], data.A[:, 0, 0], data.A_inf[0, 0] + fitted.imag / w, UNIT * 0.01),
                                    (axes[1], data.B[:, 0, 0], fitted.real, UNIT * 0.01)):
            ax.plot(wavenumber(w), ours / unit, "o", ms=3, label="section solver")
            ax.plot(wavenumber(w), fit / unit, label="subsystem, n = 3")
            ax.set(xlim=(0, 5), xlabel="K b")
        axes[0].set(ylabel="A33 / (rho b$^2$ L)")
        axes[1].set(ylabel="B33 / (rho b$^2$ L) [1/s]")
        axes[0].legend()

    figure("fig04", draw, ncols=2, figsize=(7.4, 2.9))


if __name__ == "__main__":
    main()
