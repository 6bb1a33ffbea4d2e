"""Table 3: mean of the final parameters over repeated runs, three seas."""

import numpy as np
from tank import CASES, TABLE_3, UNIT, heave_model, options, printed, sail

import radiation_ss as rss
from radiation_ss.filter.repeat import FilterStudy


def main():
    model, runs = heave_model(), options().runs
    filter_ = rss.DualEnKF(model)
    start, unit = filter_.parts.theta, np.repeat([1.0, UNIT], 3)
    rows = [["start", *(start / unit)], ["  paper's", *TABLE_3["2D-BEM"]]]
    moves, spread = {}, {}
    for case, t01 in CASES.items():
        results = rss.repeat(FilterStudy(model, sail(model, t01)[0], preset="paper", n_ensemble=100), runs, seed=3)
        final = results["theta"][~results["diverged"]]
        moves[case], spread[case] = final.mean(axis=0) / start, final.std(axis=0, ddof=1) / np.abs(start)
        rows += [[case, *(final.mean(axis=0) / unit)], ["  paper's", *TABLE_3[case]]]
    printed(rows, ["", *(name.split(".")[1] for name in filter_.parts.names)])
    print("\nmean over start, and the spread of single runs over start")
    printed([row for case in CASES for row in (
        [case, *moves[case]], ["  paper's", *(np.array(TABLE_3[case]) / TABLE_3["2D-BEM"])],
        ["  spread of one run", *spread[case]])], ["", *(name.split(".")[1] for name in filter_.parts.names)])


if __name__ == "__main__":
    main()
