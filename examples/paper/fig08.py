"""Fig. 8: the parameters' paths with 10, 100 and 1000 members (Case-3): jumpy, settled, smoother."""

import numpy as np
from tank import CASES, figure, heave_model, printed, sail

import radiation_ss as rss
from radiation_ss.style import COLOURS, band

SIZES = (10, 100, 1000)


def main():
    model = heave_model()
    record, _ = sail(model, CASES["Case-3"])
    rows, paths = [], {}
    for size in SIZES:
        estimate = rss.DualEnKF(model, preset="paper", n_ensemble=size, seed=1).run(record)
        paths[size] = estimate
        # How jumpy: the step of the mean at one sample, in units of the parameter, first second and last ten seconds.
        steps = np.abs(np.diff(estimate.theta, axis=1)) / np.abs(estimate.baseline["theta"][:, None])
        rows.append([size, steps[:, :100].max(), np.median(steps[:, -1000:]),
                     np.median(estimate.theta_std[:, -1] / np.abs(estimate.baseline["theta"]))])
    printed(rows, ["members", "largest step, 1st second", "median step, last 10 s", "spread at the end"])
    print("paper: with 10 members rapid fluctuation at the start, with 100 it settles, with 1000 it is smoother")

    def draw(axes):
        for column, (size, estimate) in enumerate(paths.items()):
            for i, ax in enumerate(axes[:, column]):
                mean, std = estimate.theta[i], estimate.theta_std[i]
                band(ax, estimate.time, mean - 1.96 * std, mean + 1.96 * std, COLOURS[column])
                ax.plot(estimate.time, mean, color=COLOURS[column])
                ax.axhline(estimate.baseline["theta"][i], color="0.4", lw=0.8, ls=":")
                ax.set(ylabel=estimate.names[i] if column == 0 else "", xlabel="t [s]" if i == 5 else "")
            axes[0, column].set(title=f"{size} members")

    figure("fig08", draw, nrows=6, ncols=3, figsize=(9.0, 9.5), sharex=True, sharey="row")


if __name__ == "__main__":
    main()
