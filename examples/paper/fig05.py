"""Fig. 5: the kernel of the heave radiation force, and the subsystem of order 3 fitted to it by (8)."""

import numpy as np
from tank import TABLE_3, UNIT, figure, heave_model, printed

from radiation_ss.inference.subsystems import Subsystems


def main():
    model, t = heave_model(), np.linspace(0.0, 2.0, 201)
    section, fitted = model.hydro.kernel(t)[:, 0, 0], model.fit.kernel(t)[:, 0, 0]
    row = np.array(TABLE_3["2D-BEM"]) * np.repeat([1.0, UNIT], 3)
    paper = Subsystems(("Heave",), ((0, 0),), (3,), row)
    theirs = paper.fit(paper.theta).kernel(t)[:, 0, 0]
    size = np.linalg.norm(section)
    printed([["L(0) / (rho L)", fitted[0] / UNIT, f"{TABLE_3['2D-BEM'][5]:.4g}"],
             ["fit against the kernel, relative", np.linalg.norm(fitted - section) / size, "'good agreement'"],
             ["paper's row against our kernel, relative", np.linalg.norm(theirs - section) / size, "-"]],
            ["", "ours", "paper"])

    def draw(ax):
        ax.plot(t[::4], section[::4] / UNIT, "o", ms=3, label="section solver (2)")
        ax.plot(t, fitted / UNIT, label="subsystem, n = 3")
        ax.plot(t, theirs / UNIT, "--", label="paper, Table 3, 2D-BEM")
        ax.set(xlabel="t [s]", ylabel="L33 / (rho L)")
        ax.legend()

    figure("fig05", draw, figsize=(5.0, 3.0))


if __name__ == "__main__":
    main()
