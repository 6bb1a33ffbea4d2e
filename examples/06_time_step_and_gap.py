"""
Time step and model difference
==============================

What the time step does to the radiation model, and how much of a controller's margin a model difference uses up.

Run: python examples/06_time_step_and_gap.py [--out FOLDER]
A zero-order hold of the radiation model is neither accurate nor passive; a first-order hold and the bilinear rule are.
Then a controller is designed, and bodies with the radiation scaled by 0 to 4 are put in: the loop stays stable as long
as the nu-gap is below the margin b(P, C), and often longer.
"""

import control as ct
from bodies import rss, save, tank_heave

METHODS, STEPS = ("zoh", "foh", "tustin"), (0.01, 0.02, 0.05, 0.1)


def study():
    """Return sampling reports, and gap and stability for scaled radiation."""
    data = tank_heave()
    fit = rss.fit_radiation(data, 3)
    model = rss.Model.from_hydro(data, fit)
    reports = {(method, dt): rss.sampled(fit, dt, method, band=8.0) for method in METHODS for dt in STEPS}
    plant = rss.cummins(model)
    # A position controller with a lag of 0.1 s: it takes damping away, so it depends on the body's own.
    controller = ct.ss(ct.tf([0.15 * model.C[0, 0]], [0.1, 1.0]))
    scale = {"input_scale": model.C[0, 0]}
    margin = rss.robust_margin(plant[0, 0], controller, **scale)
    rows = []
    for factor in (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0):
        other = rss.cummins(model.replace(fit=fit.replace(c=factor * fit.c)))[0, 0]
        stable = ct.feedback(other, controller).poles().real.max() < 0.0
        rows.append((factor, rss.gap_metric(plant[0, 0], other, **scale), rss.robust_margin(other, controller, **scale),
                     bool(stable)))
    return {"reports": reports, "margin": margin, "rows": rows, "fit": fit}


def draw(found):
    """Save the frequency error against frequency for each method at one step."""
    from radiation_ss import style

    figure, axes = style.figure(1, 1, size=(5.0, 3.2))
    for method, colour in zip(METHODS, style.COLOURS):
        report = found["reports"][method, 0.05]
        axes[0, 0].loglog(report.omega, report.error, color=colour, label=method)
    axes[0, 0].set(xlabel="frequency [rad/s]", ylabel="relative error of K", title="Time step 0.05 s", xlim=(0.5, 63.0),
                   ylim=(1e-5, 3.0))
    axes[0, 0].legend()
    return {"06_time_step": figure}


def main():
    found = study()
    print("method dt [s]  error at 8 rad/s  against convolution  passive")
    for (method, dt), report in found["reports"].items():
        print(f"{method:6} {dt:5.2f}  {report.error_at(8.0):16.1%}  {report.convolution_error:19.1%}  {report.passive}")
    print(f"\ncontroller's margin b(P, C) = {found['margin']:.3f}")
    print("radiation times  nu-gap  margin left  stable")
    for factor, gap, left, stable in found["rows"]:
        print(f"{factor:12.2f}  {gap:6.3f}  {left:11.3f}  {stable}")
    save(draw(found))


if __name__ == "__main__":
    main()
