"""Fig. 9: histograms of the final parameters over repeated runs of the paper's filter on one record (Case-3)."""

import numpy as np
from scipy.stats import kurtosis, skew
from tank import CASES, figure, heave_model, options, printed, sail

import radiation_ss as rss
from radiation_ss.filter import FilterStudy


def main():
    model, runs = heave_model(), options().runs
    record, _ = sail(model, CASES["Case-3"])
    study = FilterStudy(model, record, preset="paper", n_ensemble=100)
    results = rss.repeat(study, runs, seed=9)
    final, names = results["theta"][~results["diverged"]], rss.DualEnKF(model).parts.names
    start = rss.DualEnKF(model).parts.theta
    printed([[name, s, row.mean(), row.std(ddof=1), skew(row), kurtosis(row)]
             for name, s, row in zip(names, start, final.T)],
            ["", "start", "mean", "std", "skewness", "excess kurtosis"])
    print(f"{runs} runs, {int(results['diverged'].sum())} diverged; paper: a shape similar to a Gaussian")

    def draw(axes):
        for ax, name, row, s in zip(axes.ravel(), names, final.T, start):
            low, high = np.quantile(row, (0.01, 0.99))
            ax.hist(row, bins=30, range=(low, high))
            ax.axvline(row.mean(), color="k", ls="--")
            ax.axvline(s, color="0.5", ls=":")
            ax.set(title=name)

    figure("fig09", draw, nrows=2, ncols=3, figsize=(8.0, 4.4))


if __name__ == "__main__":
    main()
