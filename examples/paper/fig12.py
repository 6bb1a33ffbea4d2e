"""Fig. 12: wave-exciting force in heave from motion alone, three seas, beside the true force."""

from tank import CASES, figure, force_error, frequency, heave_model, perturbed, printed, sail

import radiation_ss as rss
from radiation_ss.style import BLUE, band


def main():
    body, rows, shown = heave_model(), [], {}
    for case, t01 in CASES.items():
        record, force = sail(body, t01)
        for start, name in ((body, "start = section solver"), (perturbed(body, 12), "start 15 % off")):
            for label, settings in (("paper's filter", {"preset": "paper"}), ("default", {}),
                                    ("default, K b = 0.3 and 1 known", {"points": frequency([0.3, 1.0])})):
                estimate = rss.DualEnKF(start, seed=1, **settings).run(record)
                error, cover = force_error(estimate, force)
                rows.append([case, name, label, error[0], f"{100 * cover[0]:.0f} %"])
                if start is body and label == "default":
                    shown[case] = estimate, force
    printed(rows, ["", "", "", "NRMSE", "95 % band covers"])
    print("paper: 'good agreement with that obtained in the diffraction test', no number given")

    def draw(axes):
        for ax, (case, (estimate, force)) in zip(axes, shown.items()):
            part = estimate.time < 12.0
            mean, low, high = (values[0, part] for values in estimate.force)
            band(ax, estimate.time[part], low, high, BLUE)
            ax.plot(estimate.time[part], mean, color=BLUE, label="default filter")
            ax.plot(estimate.time[part][::8], force[0, part][::8], "k.", ms=3, label="true")
            ax.set(title=case, ylabel="f [N]")
        axes[0].legend(ncols=2)
        axes[-1].set(xlabel="t [s]")

    figure("fig12", draw, nrows=3, figsize=(7.0, 5.6), sharex=True)


if __name__ == "__main__":
    main()
