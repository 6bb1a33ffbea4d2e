"""Fig. 13: simulated sway and roll in irregular waves, deep water (H1/3 = 10 mm, T01 = 1.0 s)."""

from tank import figure, printed, sail, sway_roll_model


def main():
    record, _ = sail(sway_roll_model(), 1.0)
    units = {"Sway": "m", "Roll": "rad"}
    printed([[name, record.channels[name].std(), units[name.split("_")[0]] + {"": "", "velocity": "/s",
              "acceleration": "/s2"}[name.partition("_")[2]]] for name in record.channels], ["", "rms", "unit"])
    print("paper: drawn, no numbers given")

    def draw(axes):
        for ax, suffix in zip(axes, ("", "_velocity", "_acceleration")):
            ax.plot(record.time, record.channels["Sway" + suffix], "--", label="sway [m]")
            ax.plot(record.time, 0.1 * record.channels["Roll" + suffix], label="b times roll [m]")
            ax.set(ylabel=suffix.strip("_") or "displacement")
        axes[0].legend(ncols=2)
        axes[-1].set(xlabel="t [s]")

    figure("fig13", draw, nrows=3, figsize=(7.0, 5.0), sharex=True)


if __name__ == "__main__":
    main()
