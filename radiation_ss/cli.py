"""The command line: radiation-ss VERB ... (see `radiation-ss --help`)."""

from __future__ import annotations

import argparse
import json
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from radiation_ss.errors import InputError, RadiationError

if TYPE_CHECKING:
    from radiation_ss.body.model import Model
    from radiation_ss.fit.result import RadiationFit
    from radiation_ss.hydro.data import HydroData
    from radiation_ss.records.record import Record

# Largest relative error of the memory where motions are predicted.
PREDICTION = 0.005
# Relative error of a fit from which on a word is said.
POOR = 0.1
# Numbers of `model`: name, unit, meaning; hyphens become underscores, but for the names below.
MODEL_NUMBERS = (
    ("mass", "KG", "mass"), ("gm", "M", "metacentric height of Roll or Pitch"),
    ("stiffness", "C", "N/m or N m/rad, instead of --gm"), ("gyradius", "M", "radius of gyration of a rotation"),
    ("period", "S", "period of a free decay"), ("damping-ratio", "Z", "damping ratio of a free decay (0.05 is 5 %%)"),
    ("added-mass", "KG", "at infinite frequency, kg or kg m^2"), ("length", "M", "length of the body of --section"),
    ("centre-of-gravity", "M", "height z, up from the water surface"), ("rho", "KG/M3", "water density (1000)"),
    ("depth", "M", "water depth for --section (deep)"))
PYTHON_NAMES = {"gm": "GM", "stiffness": "C"}
Verb = Callable[[argparse.Namespace], None]
Maker = Callable[[str, Verb, str, str], argparse.ArgumentParser]

EPILOG = """\
MODEL is a Capytaine .nc file that carries inertia_matrix and hydrostatic_stiffness; --fit takes the memory from a
FIT.json instead of fitting it anew. RECORD is a CSV file: time [s], Heave [m], Heave_force [N], wave_elevation [m] ...
Exit status: 0 done; 2 bad input, with one line that says what and where; 1 a failure of ours."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, as every other complaint of the program."""

    def error(self, message: str) -> NoReturn:
        """Leave with status 2 and one line."""
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def parser() -> argparse.ArgumentParser:
    """Return the argument parser with all verbs."""
    from radiation_ss import __version__

    top = Parser(prog="radiation-ss", epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter,
                 description="Radiation subsystems of floating bodies: fit, identify, diagnose.")
    top.add_argument("--version", action="version", version=__version__)
    verbs = top.add_subparsers(title="verbs", metavar="VERB", required=True)

    def verb(name: str, action: Verb, summary: str, description: str) -> argparse.ArgumentParser:
        made = verbs.add_parser(name, help=summary, description=description, epilog=EPILOG,
                                formatter_class=argparse.RawDescriptionHelpFormatter)
        made.set_defaults(action=action)
        made.add_argument("--json", action="store_true", help="print the result as JSON and nothing else")
        return made

    demo = verb("demo", demo_verb, "the paper's tank, start to end, with a page to look at",
                "Section solver, passive fit, 30 s of waves, dual filter, spectral estimate, and the diagnosis of an\n"
                "effect that the model does not know. Writes OUT/report.html.")
    demo.add_argument("--out", type=Path, default=Path("demo"), metavar="DIR", help="folder to write (default: demo)")
    demo.add_argument("--seed", type=int, default=0, help="seed of all randomness (default: 0)")

    add_hydro_verbs(verb)
    add_record_verbs(verb)
    add_blind(verb("blind", blind_verb, "the withheld check: sealed cases, diagnosed, then scored",
                   "Effects are hidden in simulated records by an independent integrator; labels stay sealed."))
    return top


def add_hydro_verbs(verb: Maker) -> None:
    """Add the verbs that work on hydrodynamic data."""
    check = verb("check", check_verb, "quality of hydrodynamic data",
                 "Negative or indefinite damping, asymmetry, Kramers-Kronig residual, spikes, tail, missing A_inf.")
    hydro_argument(check)
    check.add_argument("--out", type=Path, metavar="PICTURE", help="also draw the check into this .png or .svg")

    fit = verb("fit", fit_verb, "a stable, passive radiation subsystem",
               "Fits K(iw) = B + iw(A - A_inf) and writes FIT.json (or .ss for OpenFAST, .h5, .mat).")
    hydro_argument(fit)
    fit.add_argument("--order", type=int, metavar="N", help="order; chosen and explained if not given")
    fit.add_argument("--points", type=float, nargs="+", metavar="W",
                     help="frequencies [rad/s] at which K is met exactly")
    fit.add_argument("--at-zero", type=zero_rule, default="free", metavar="free|zero|VALUE",
                     help="K(0): free (default), zero, or a value [kg/s]")
    fit.add_argument("--dofs", nargs="+", metavar="DOF", help="only these degrees of freedom")
    fit.add_argument("--out", type=Path, required=True, metavar="FIT.json")

    model = verb("model", model_verb, "a model from what a decay or an inclining test gives",
                 "Mass, stiffness, period and damping ratio of one degree of freedom, or a section's offsets with the\n"
                 "length of the body. Writes MODEL.nc and prints the model.")
    model.add_argument("--dof", metavar="DOF", help="Surge, Sway, Heave, Roll, Pitch or Yaw")
    for name, unit, what in MODEL_NUMBERS:
        model.add_argument(f"--{name}", type=float, metavar=unit, help=what)
    model.add_argument("--radiation", type=Path, metavar="HYDRO", help="radiation from a hydrodynamic file")
    model.add_argument("--section", type=Path, metavar="OFFSETS", help="offsets y, z [m] of a section; needs --length")
    model.add_argument("--tolerance", default="", metavar="T",
                       help="how far numbers may be off, relative: gyradius=0.1,gm=0.02,kernel=0.2")
    model.add_argument("--name", default=None, metavar="NAME")
    model.add_argument("--out", type=Path, required=True, metavar="MODEL.nc")

    audit = verb("audit", audit_verb, "score somebody else's radiation model",
                 "Stability, passivity, margin and error of a FIT.json, OpenFAST .ss, BEMIO .h5 or .mat model.")
    hydro_argument(audit)
    audit.add_argument("radiation_model", type=Path, metavar="MODEL", help="the radiation model to score")


def add_record_verbs(verb: Maker) -> None:
    """Add the verbs that work on a model and records."""
    simulate = verb("simulate", simulate_verb, "motion under a record's force and start",
                    "Predicts the record's motion; --corrected adds what a diagnosis found.")
    model_argument(simulate)
    simulate.add_argument("record", type=Path, metavar="RECORD")
    simulate.add_argument("--corrected", type=Path, metavar="C.json", help="corrected.json written by diagnose")
    simulate.add_argument("--out", type=Path, required=True, metavar="PRED.csv")

    identify = verb("identify", identify_verb, "added mass, damping and wave force from motion, with bands",
                    "Writes identify.json, one force CSV for each record, and pictures.")
    model_argument(identify)
    identify.add_argument("records", type=Path, nargs="+", metavar="RECORD")
    identify.add_argument("--method", default="spectral", metavar="M",
                          help="spectral (default), dual-enkf, joint, prediction-error or points")
    identify.add_argument("--prior", type=float, default=0.15, help="relative sd of the radiation parameters (0.15)")
    identify.add_argument("--points", type=float, nargs="+", metavar="W",
                          help="frequencies [rad/s] at which the model's own K is held")
    identify.add_argument("--seed", type=int, default=0, help="seed of all randomness (default: 0)")
    identify.add_argument("--out", type=Path, required=True, metavar="DIR")

    plan = verb("plan", plan_verb, "which tests to do, before any is done",
                "Runs the model through a menu of standard tests and chooses those that show most effects and tell\n"
                "most of them apart; says what stays inseparable, and why. With --out writes plan.json and plan.png.")
    model_argument(plan)
    plan.add_argument("--amplitude", type=float, metavar="X", help="largest displacement in the tests [m or rad]")
    plan.add_argument("--sea", type=float, nargs=2, metavar=("HS", "TP"), help="the waves: height [m], peak period [s]")
    plan.add_argument("--tests", nargs="+", metavar="NAME", help="only tests whose name begins so: decay waves")
    plan.add_argument("--noise", type=float, default=0.01, help="of the sensors, as a share of the motion (0.01)")
    tolerance_argument(plan)
    plan.add_argument("--out", type=Path, metavar="DIR")

    diagnose = verb("diagnose", diagnose_verb, "why model and measurement differ, and how far the gap shrinks",
                    "Writes report.json, report.html and corrected.json.")
    model_argument(diagnose)
    diagnose.add_argument("records", type=Path, nargs="+", metavar="RECORD")
    diagnose.add_argument("--withhold", type=Path, action="append", default=[], metavar="RECORD",
                          help="a record that no fit sees: the shrinkage is measured on it (may be repeated)")
    tolerance_argument(diagnose)
    diagnose.add_argument("--bootstrap", type=int, default=0, metavar="N",
                          help="simulate N nulls and fit each anew for the threshold of the evidence (slow; kept in "
                               "DIR/null.json; default: 0, linearised nulls only)")
    diagnose.add_argument("--seed", type=int, default=0, help="seed of all randomness (default: 0)")
    diagnose.add_argument("--out", type=Path, required=True, metavar="DIR")


def hydro_argument(to: argparse.ArgumentParser) -> None:
    """Add HYDRO and its format."""
    to.add_argument("hydro", type=Path, metavar="HYDRO",
                    help="Capytaine .nc, BEMIO .h5, WAMIT .1/.out, NEMOH folder, AQWA .AH1 or MSS .mat")
    to.add_argument("--format", metavar="NAME", help="file format, where the name does not tell")
    for name, unit, what in (("rho", "KG/M3", "water density"), ("length", "M", "WAMIT's length scale ULEN")):
        to.add_argument(f"--{name}", type=float, metavar=unit, help=f"{what}, where the file does not carry it")


def read_hydro_argument(args: argparse.Namespace) -> HydroData:
    """Read HYDRO with the options that `hydro_argument` adds."""
    from radiation_ss import read_hydro

    return read_hydro(args.hydro, args.format, rho=args.rho, length=args.length)


def model_argument(to: argparse.ArgumentParser) -> None:
    """Add MODEL, its fit and order."""
    to.add_argument("model", type=Path, metavar="MODEL", help="Capytaine .nc with inertia and hydrostatics")
    to.add_argument("--fit", type=Path, metavar="FIT.json", help="radiation subsystem to use (default: fit it)")
    to.add_argument("--order", type=int, metavar="N", help="order of the fit; chosen if not given")
    to.add_argument("--dofs", nargs="+", metavar="DOF",
                    help="degrees of freedom of the model to keep (default: those that the records measure)")
    to.add_argument("--ignore", action="append", default=[], metavar="COLUMN",
                    help="a column of the records to leave out (may be repeated)")


def tolerance_argument(to: argparse.ArgumentParser) -> None:
    """Add --tolerance."""
    to.add_argument("--tolerance", default="0.02", metavar="T",
                    help="relative tolerance of mass, stiffness, A_inf, kernel and force (default: 0.02), or by name: "
                         "kernel=0.1,force=0.05")


def add_blind(to: argparse.ArgumentParser) -> None:
    """Add `blind run` and `blind score`."""
    steps = to.add_subparsers(title="steps", metavar="STEP", required=True)
    run = steps.add_parser("run", help="make sealed cases and diagnose each")
    run.add_argument("folder", type=Path, metavar="DIR")
    run.add_argument("--cases", type=int, default=20, help="how many cases (default: 20)")
    run.add_argument("--mix", default="standard", help="standard, nulls (nothing hidden), or none=.5,single=.5")
    run.add_argument("--seed", type=int, help="default: fresh from the system, kept under the seal")
    run.add_argument("--workers", type=at_least_one, default=1, metavar="N",
                     help="processes that diagnose (default: 1)")
    run.set_defaults(step="run")
    score = steps.add_parser("score", help="open the seal and score")
    score.add_argument("folder", type=Path, metavar="DIR")
    score.set_defaults(step="score")


def tolerance_of(text: str) -> float | dict[str, float]:
    """Read --tolerance: a number for all, or single ones by name, with commas between."""
    try:
        if "=" not in text:
            return float(text)
        return {name.strip(): float(value) for name, _, value in (part.partition("=") for part in text.split(","))}
    except ValueError:
        raise InputError(f"--tolerance {text}: not understood; write 0.02, or kernel=0.1,force=0.05") from None


def at_least_one(text: str) -> int:
    """Read a number of workers."""
    if (count := int(text)) < 1:
        raise argparse.ArgumentTypeError(f"{count} is too few; give 1 or more")
    return count


def zero_rule(text: str) -> str | float:
    """Read --at-zero: a word or a number."""
    return text if text in ("free", "zero") else float(text)


def say(args: argparse.Namespace, result: Any, text: str) -> None:
    """Print the result: JSON where it was asked for, else text."""
    print(json.dumps(result, indent=1, default=float) if args.json else text)


def model_of(args: argparse.Namespace, records: Sequence[Record], accuracy: float | None = None) -> Model:
    """Read the MODEL argument, narrowed to the degrees of freedom asked for or measured."""
    import radiation_ss as rss

    data = rss.read_hydro(args.model)
    measured = {dof for record in records for dof in record.dofs}
    dofs = args.dofs or [dof for dof in data.dofs if dof in measured]
    if not dofs:
        raise InputError(f"{args.model}: its degrees of freedom {list(data.dofs)} are none of those that the records "
                         f"measure, {sorted(measured)}")
    if len(dofs) < data.n and not args.dofs:
        left = ", ".join(dof for dof in data.dofs if dof not in dofs)
        args.notes.append(f"{args.model}: {left} not measured by any record and left out (--dofs keeps them)")
    model = rss.read_model(args.model, args.fit, dofs=dofs, order=args.order, accuracy=accuracy)
    args.notes += [f"{args.model}: {note}" for note in (model.hydro or data).notes[len(data.notes):]]
    if args.fit is None:
        args.notes += poor_fit(model.fit, args.model)
    return model


def poor_fit(fit: RadiationFit, source: Path) -> list[str]:
    """Return a sentence where the memory is not what the file says, else nothing."""
    error = fit.relative_error or 0.0
    if error <= POOR:
        return []
    return [f"{source}: the fitted memory is {error:.0%} (rms) off the file's coefficients; `radiation-ss check` says "
            "where these are no causal, passive pair (irregular frequencies, negative damping)"]


def demo_verb(args: argparse.Namespace) -> None:
    """Run the paper's tank from section to page."""
    from radiation_ss.report.demo import run_demo
    from radiation_ss.report.progress import progress_bar

    with progress_bar() as tell:
        result = run_demo(args.out, seed=args.seed, progress=tell)
    say(args, result.summary, f"{result.text}\nLook at {args.out / 'report.html'}")


def check_verb(args: argparse.Namespace) -> None:
    """Report on the quality of hydrodynamic data."""
    report = read_hydro_argument(args).check()
    if args.out is not None:
        report.plot().savefig(args.out)
    say(args, report.to_dict(), str(report))


def fit_verb(args: argparse.Namespace) -> None:
    """Fit a radiation subsystem and write it."""
    import radiation_ss as rss

    data = read_hydro_argument(args)
    if args.dofs:
        data = data.select(args.dofs)
    fit = rss.fit_radiation(data, args.order, points=args.points, at_zero=args.at_zero)
    fit.write(args.out)
    args.notes += poor_fit(fit, args.hydro)
    say(args, {"order": fit.order, "states": fit.states, "stable": fit.stable, "passive": fit.passive,
               "passivity_margin": fit.passivity_margin, "relative_error": fit.relative_error,
               "out": str(args.out)}, f"{fit!r}\nwritten: {args.out}")


def model_verb(args: argparse.Namespace) -> None:
    """Make a model from a few numbers and write it."""
    import radiation_ss as rss

    words = [name.replace("-", "_") for name, _, _ in MODEL_NUMBERS]
    numbers = {PYTHON_NAMES.get(word, word): getattr(args, word) for word in ["dof", *words, "radiation", "section"]
               if getattr(args, word) is not None}
    said = tolerance_of(args.tolerance) if args.tolerance else {}
    if not isinstance(said, dict):
        raise InputError(f"--tolerance {args.tolerance}: say of what, for example gyradius=0.1,kernel=0.2")
    tolerance = {PYTHON_NAMES.get(name, name): value for name, value in said.items()}
    made = rss.body(**numbers, tolerance=tolerance, name=args.name or args.out.stem)
    made.write(args.out)
    say(args, {"out": str(args.out), "dofs": list(made.dofs), "M": made.M.tolist(), "A_inf": made.A_inf.tolist(),
               "C": made.C.tolist(), "D": made.D.tolist(), "tolerance": dict(made.tolerance)},
        f"{made}\nwritten: {args.out}")


def audit_verb(args: argparse.Namespace) -> None:
    """Score a radiation model against data."""
    import radiation_ss as rss

    report = rss.audit(args.radiation_model, read_hydro_argument(args))
    say(args, report.to_dict(), str(report))


def simulate_verb(args: argparse.Namespace) -> None:
    """Predict a record's motion and write it."""
    import radiation_ss as rss
    from radiation_ss.simulation.run import predict_record

    record = rss.read_record(args.record, ignore=args.ignore)
    predicted = predict_record(model_of(args, [record], PREDICTION), record, corrected=args.corrected)
    rss.write_record(predicted, args.out)
    say(args, {"out": str(args.out), "samples": int(predicted.time.size)}, f"written: {args.out}")


def identify_verb(args: argparse.Namespace) -> None:
    """Estimate coefficients and force from motion."""
    import radiation_ss as rss

    records = [rss.read_record(path, ignore=args.ignore) for path in args.records]
    found = rss.identify(model_of(args, records), records, method=args.method, prior=args.prior, points=args.points,
                         seed=args.seed)
    found.save(args.out)
    say(args, json.loads((args.out / "identify.json").read_text(encoding="utf-8")),
        f"{found}\nwritten: {args.out / 'identify.json'}")


def plan_verb(args: argparse.Namespace) -> None:
    """Plan tests from a model alone."""
    import radiation_ss as rss

    args.dofs = args.dofs or list(rss.read_hydro(args.model).dofs)
    made = rss.plan_tests(model_of(args, [], PREDICTION), args.amplitude, tolerance=tolerance_of(args.tolerance),
                          noise=args.noise, sea=None if args.sea is None else tuple(args.sea), tests=args.tests)
    if args.out is not None:
        made.save(args.out)
    say(args, made.to_dict(), str(made) + (f"\nLook at {args.out / 'plan.png'}" if args.out is not None else ""))


def diagnose_verb(args: argparse.Namespace) -> None:
    """Diagnose the sim-to-real gap."""
    import radiation_ss as rss
    from radiation_ss.report.progress import progress_bar

    tolerance = tolerance_of(args.tolerance)
    records = [rss.read_record(path, ignore=args.ignore) for path in args.records]
    withheld = [rss.read_record(path, ignore=args.ignore) for path in args.withhold]
    model = model_of(args, records, PREDICTION)
    with progress_bar() as tell:
        found = rss.diagnose(model, records, withhold=withheld, tolerance=tolerance, seed=args.seed, progress=tell,
                             bootstrap=args.bootstrap, cache=args.out / "null.json")
    found.save(args.out)
    say(args, json.loads((args.out / "report.json").read_text(encoding="utf-8")),
        f"{found}\nLook at {args.out / 'report.html'}")


def blind_verb(args: argparse.Namespace) -> None:
    """Run or score the withheld check."""
    import radiation_ss.blind as blind

    result: Any

    if args.step == "run":
        with ThreadPoolExecutor(args.workers) as executor:
            result = blind.run(args.folder, cases=args.cases, seed=args.seed, mix=args.mix, executor=executor)
    else:
        result = blind.score(args.folder)
    say(args, result.to_dict(), str(result))


def complain(text: object) -> None:
    """Say one line on standard error."""
    print(f"radiation-ss: {' '.join(str(text).split())}", file=sys.stderr)


def one_line_warning(message: Warning | str, *_: object) -> None:
    """Show a warning as one line, without the place in our sources; in the place of `warnings.showwarning`."""
    complain(f"warning: {message}")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return 0 when done, 2 for bad input, 1 for a failure of ours."""
    args = parser().parse_args(argv)
    args.notes = []
    with warnings.catch_warnings():
        warnings.showwarning = one_line_warning  # type: ignore[assignment]
        try:
            args.action(args)
        except (InputError, OSError) as error:
            complain(error)
            return 2
        except RadiationError as error:
            complain(error)
            return 1
        except Exception as error:
            at = traceback.extract_tb(error.__traceback__)[-1]
            complain(f"a failure of the program, not of your files: {type(error).__name__}: {error} "
                     f"({Path(at.filename).name}, line {at.lineno}); please report it with the command")
            return 1
    for note in args.notes:
        complain(note)
    return 0
