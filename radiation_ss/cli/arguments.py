"""The command line: its verbs and their options, and their completion in bash and zsh."""

import argparse
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from radiation_ss.cli.output import Parser, failed, interrupts, log_to_stderr, note, show, warn
from radiation_ss.cli.scenario import USUAL_DECAY, USUAL_SEA
from radiation_ss.methods import later
from radiation_ss.records.record import KINDS

Maker = Callable[..., argparse.ArgumentParser]

HYDRO = """\
HYDRO: Capytaine .nc, BEMIO .h5, WAMIT .1/.out, AQWA .AH1/.LIS, OrcaFlex .yml, MSS .mat, or the folder of a NEMOH, HAMS
or HydroStar run."""
MODEL = """\
MODEL: a Capytaine .nc file with inertia_matrix and hydrostatic_stiffness; --fit takes the radiation model from a
FIT.json instead of fitting it."""
RECORD = "RECORD: a CSV file with the columns time [s], Heave [m], Heave_force [N], wave_elevation [m] ..."
STATUS = "Exit status: 0 done; 2 bad input, one line says what and where; 1 an internal error; 130 after Ctrl-C."
# Numbers of `model`: name, unit, meaning
MODEL_NUMBERS = (
    ("mass", "KG", "mass"), ("gm", "M", "metacentric height of Roll or Pitch"),
    ("stiffness", "C", "N/m or N m/rad, instead of --gm"),
    ("gyradius", "M", "radius of gyration, about G where --centre-of-gravity is given, else about the axis"),
    ("period", "S", "period of a free decay"), ("damping-ratio", "Z", "damping ratio of a free decay (0.05 is 5 %%)"),
    ("added-mass", "KG", "at infinite frequency, kg or kg m^2"), ("length", "M", "length of the body of --section"),
    ("centre-of-gravity", "M", "height z, up from the water surface"), ("rho", "KG/M3", "water density (1000)"),
    ("depth", "M", "water depth for --section (deep)"))
BASH = """\
_radiation_ss() {{
  local words cur=${{COMP_WORDS[COMP_CWORD]}}
  case $COMP_CWORD/${{COMP_WORDS[1]}} in
    1/*) words="{verbs}" ;;
{cases}
  esac
  COMPREPLY=($(compgen -W "$words" -- "$cur"))
  if [[ $COMP_CWORD -gt 1 && $cur != -* ]]; then COMPREPLY+=($(compgen -f -- "$cur")); fi
}}
complete -o filenames -F _radiation_ss radiation-ss
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return 0 when done, 2 for bad input, 1 for an internal error, 130 after Ctrl-C."""
    args = parser().parse_args(argv)
    args.notes = []
    with log_to_stderr(args), warnings.catch_warnings(), interrupts(argv is None) as watch:
        warnings.showwarning = warn  # type: ignore[assignment]
        try:
            args.action(args)
            watch.over = True
        except BaseException as error:  # the program's end: each becomes a line and a status, or goes on from failed()
            watch.over = True
            return failed(error, watch.seen)
        for text in args.notes:
            note(text)
    return 0


def parser() -> argparse.ArgumentParser:
    """Return the argument parser with all verbs."""
    from radiation_ss import __version__

    top = Parser(prog="radiation-ss", epilog="\n".join([HYDRO, MODEL, RECORD, STATUS]),
                 formatter_class=argparse.RawDescriptionHelpFormatter,
                 description="Radiation models of floating bodies: fit, identify, diagnose.")
    top.add_argument("--version", action="version", version=__version__)
    made = top.add_subparsers(title="verbs", metavar="VERB", required=True, dest="verb")

    def verb(name: str, summary: str, description: str, *files: str) -> argparse.ArgumentParser:
        one = made.add_parser(name, help=summary, description=description, epilog="\n".join([*files, STATUS]),
                              formatter_class=argparse.RawDescriptionHelpFormatter)
        one.set_defaults(action=partial(later, f"cli.verbs:{name}"))
        one.add_argument("--json", action="store_true", help="print the result as JSON and nothing else")
        loud = one.add_mutually_exclusive_group()
        loud.add_argument("--verbose", action="store_true", help="say what is being done")
        loud.add_argument("--quiet", action="store_true", help="no notes, warnings or progress")
        return one

    demo = verb("demo", "a tank test, start to end, with a page to look at",
                "Section solver, passive fit, 30 s of waves, dual filter, spectral estimate, and the diagnosis of an\n"
                "effect that the model does not have. Writes OUT/report.html.")
    demo.add_argument("--out", type=Path, default=Path("demo"), metavar="DIR", help="folder to write (default: demo)")
    seed_argument(demo)
    add_hydro_verbs(verb)
    add_record_verbs(verb)
    add_diagnosis_verbs(verb)
    add_blind(verb("blind", "the withheld check: sealed cases, diagnosed, then scored",
                   "Effects are hidden in simulated records by an independent integrator; labels stay sealed."))
    completion = verb("completion", "a script that completes words in the shell",
                      'Prints the script; put  eval "$(radiation-ss completion bash)"  into ~/.bashrc, zsh: ~/.zshrc.')
    completion.set_defaults(action=lambda args: show(script(top, args.shell)))
    completion.add_argument("shell", choices=("bash", "zsh"))
    return top


def add_hydro_verbs(verb: Maker) -> None:
    """Add the verbs that work on hydrodynamic data, and the one that makes a model from a few numbers."""
    check = verb("check", "quality of hydrodynamic data",
                 "Negative or indefinite damping, asymmetry, Kramers-Kronig residual, outliers, tail, missing A_inf.",
                 HYDRO)
    hydro_argument(check)
    check.add_argument("--out", type=Path, metavar="PICTURE", help="also draw the check into this .png or .svg")

    fit = verb("fit", "a stable, passive radiation model",
               "Fits K(iw) = B + iw(A - A_inf) and writes FIT.json (or .ss for OpenFAST, .h5, .mat).", HYDRO)
    hydro_argument(fit)
    fit.add_argument("--order", type=int, metavar="N", help="order; chosen and explained if not given")
    fit.add_argument("--points", type=float, nargs="+", metavar="W",
                     help="frequencies [rad/s] at which K is met exactly")
    fit.add_argument("--at-zero", type=zero_rule, default="free", metavar="free|zero|VALUE",
                     help="K(0): free (default), zero, or a value [kg/s]")
    fit.add_argument("--dofs", nargs="+", metavar="DOF", help="only these degrees of freedom")
    fit.add_argument("--out", type=Path, required=True, metavar="FIT.json")

    audit = verb("audit", "score another radiation model",
                 "Stability, passivity, margin and error of a radiation model against HYDRO.", HYDRO)
    hydro_argument(audit)
    audit.add_argument("radiation_model", type=Path, metavar="MODEL",
                       help="the radiation model to score: FIT.json, OpenFAST .ss, BEMIO .h5 or .mat")

    model = verb("model", "a model from what a decay or an inclining test gives",
                 "Mass, stiffness, period and damping ratio of one degree of freedom, or a section's offsets with the\n"
                 "length of the body. Writes MODEL.nc and prints the model.", HYDRO)
    model.add_argument("--dof", metavar="DOF", help="Surge, Sway, Heave, Roll, Pitch or Yaw; flap=rad, of your own")
    for name, unit, what in MODEL_NUMBERS:
        model.add_argument(f"--{name}", type=float, metavar=unit, help=what)
    model.add_argument("--radiation", type=Path, metavar="HYDRO", help="radiation from a hydrodynamic file")
    model.add_argument("--section", type=Path, metavar="OFFSETS", help="offsets y, z [m] of a section; needs --length")
    model.add_argument("--tolerance", default=None, metavar="T",
                       help="how far numbers may be off, relative: gyradius=0.1,gm=0.02,kernel=0.2")
    model.add_argument("--name", default=None, metavar="NAME")
    model.add_argument("--out", type=Path, required=True, metavar="MODEL.nc")


def add_record_verbs(verb: Maker) -> None:
    """Add the verbs that simulate and identify."""
    simulate = verb("simulate", "motion under a record's force and start, in a sea, or in a decay",
                    "Predicts the record's motion; without a record that in a sea (--sea) or a decay (--decay).",
                    MODEL, RECORD)
    model_argument(simulate)
    record_options(simulate)
    simulate.add_argument("record", type=Path, nargs="?", metavar="RECORD")
    simulate.add_argument("--sea", type=float, nargs=2, metavar=("HS", "TP"),
                          help="JONSWAP sea: significant height [m], peak period [s]")
    simulate.add_argument("--heading", type=float, metavar="DEG",
                          help="where the sea runs to (default: the file's only direction, else 0, along x)")
    simulate.add_argument("--outside", type=float, default=0.01, metavar="SHARE",
                          help="largest share of the sea's energy, outside the frequencies of the file's wave "
                               "excitation force, that may be left out of the force (0.01)")
    simulate.add_argument("--decay", nargs="+", metavar="DOF=X",
                          help="displacements at release [m or rad], or with a unit: Heave=0.5 Roll=10deg")
    simulate.add_argument("--duration", type=float, metavar="S",
                          help=f"default: {USUAL_SEA:g} s of sea, {USUAL_DECAY:g} periods of a decay")
    seed_argument(simulate)
    simulate.add_argument("--corrected", type=Path, metavar="C.json", help="corrected.json written by diagnose")
    simulate.add_argument("--out", type=Path, required=True, metavar="PRED.csv")

    identify = verb("identify", "added mass, damping and wave force from motion, with bands",
                    "Writes identify.json, a CSV of each force that is estimated, and pictures.", MODEL, RECORD)
    model_argument(identify)
    record_options(identify)
    identify.add_argument("records", type=Path, nargs="+", metavar="RECORD")
    identify.add_argument("--method", metavar="M",
                          help="spectral (default), dual-enkf, joint, prediction-error, points, or paper")
    identify.add_argument("--preset", choices=("paper",), help="the dual filter as printed; same as --method paper")
    for option, what in (("--q-theta", "parameters"), ("--q-state", "state"), ("--q-force", "force"),
                         ("--r", "observations")):
        identify.add_argument(option, type=float, metavar="Q",
                              help=f"variance of the paper's noise of the {what}, non-dimensional")
    identify.add_argument("--prior", type=float, default=0.15, help="relative sd of the radiation parameters (0.15)")
    identify.add_argument("--points", type=float, nargs="+", metavar="W",
                          help="frequencies [rad/s] at which the model's own K is held")
    seed_argument(identify)
    identify.add_argument("--out", type=Path, required=True, metavar="DIR")


def add_diagnosis_verbs(verb: Maker) -> None:
    """Add the verbs that plan tests and diagnose."""
    plan = verb("plan", "which tests to do, before any is done",
                "Runs the model through a menu of standard tests and chooses those that show most effects and tell\n"
                "most of them apart; says what stays inseparable, and why. With --out writes plan.json and plan.png.",
                MODEL)
    model_argument(plan)
    plan.add_argument("--amplitude", type=float, metavar="X", help="largest displacement in the tests [m or rad]")
    plan.add_argument("--sea", type=float, nargs=2, metavar=("HS", "TP"), help="the waves: height [m], peak period [s]")
    plan.add_argument("--tests", nargs="+", metavar="NAME", help="only tests whose name begins so: decay waves")
    plan.add_argument("--effects", nargs="+", metavar="NAME", help="the only effects to consider")
    plan.add_argument("--noise", type=float, default=0.01, help="of the sensors, as a share of the motion (0.01)")
    tolerance_argument(plan)
    plan.add_argument("--out", type=Path, metavar="DIR")

    diagnose = verb("diagnose", "why model and measurement differ, and how far the gap shrinks",
                    "Writes report.json, report.html and corrected.json.", MODEL, RECORD)
    model_argument(diagnose)
    record_options(diagnose)
    diagnose.add_argument("records", type=Path, nargs="+", metavar="RECORD")
    diagnose.add_argument("--withhold", type=Path, action="append", default=[], metavar="RECORD",
                          help="a record that no fit sees: the shrinkage is measured on it (may be repeated)")
    tolerance_argument(diagnose)
    for name, text in (("effects", "the only effects to consider"), ("absent", "effects that this rig cannot have"),
                       ("present", "effects that it has for certain")):
        diagnose.add_argument(f"--{name}", nargs="+", metavar="NAME", help=text)
    seed_argument(diagnose)
    diagnose.add_argument("--out", type=Path, required=True, metavar="DIR")


def add_blind(to: argparse.ArgumentParser) -> None:
    """Add `blind run` and `blind score`."""
    steps = to.add_subparsers(title="steps", metavar="STEP", required=True)
    run = steps.add_parser("run", help="make sealed cases and diagnose each")
    run.add_argument("folder", type=Path, metavar="DIR")
    run.add_argument("--cases", type=int, help="how many cases (default: 20, or those of a run that was begun)")
    run.add_argument("--mix", default="standard", help="standard, nulls (nothing hidden), or none=.5,single=.5")
    run.add_argument("--seed", type=whole, help="default: fresh from the system, kept under the seal")
    run.add_argument("--workers", type=partial(whole, least=1), default=1, metavar="N",
                     help="processes that diagnose (default: 1)")
    run.set_defaults(step="run")
    score = steps.add_parser("score", help="open the seal and score")
    score.add_argument("folder", type=Path, metavar="DIR")
    score.set_defaults(step="score")


def hydro_argument(to: argparse.ArgumentParser) -> None:
    """Add HYDRO and its format."""
    to.add_argument("hydro", type=Path, metavar="HYDRO")
    to.add_argument("--format", metavar="NAME", help="file format, where the name does not tell")
    for name, unit, what in (("rho", "KG/M3", "water density"), ("depth", "M", "water depth"),
                             ("length", "M", "WAMIT's length scale ULEN")):
        to.add_argument(f"--{name}", type=float, metavar=unit, help=f"{what}, where the file does not carry it")
    to.add_argument("--first-column", metavar="WHAT", help="of WAMIT's files: period, omega, wavenumber, wavelength")
    for name, what in (("vessel", "vessel type"), ("draught", "draught of the vessel type")):
        to.add_argument(f"--{name}", metavar="NAME", help=f"the {what}, where an OrcaFlex file holds several")


def model_argument(to: argparse.ArgumentParser) -> None:
    """Add MODEL, its fit and order."""
    to.add_argument("model", type=Path, metavar="MODEL")
    to.add_argument("--fit", type=Path, metavar="FIT.json", help="radiation model to use (default: fit it)")
    to.add_argument("--order", type=int, metavar="N", help="order of the fit; chosen if not given")
    to.add_argument("--dofs", nargs="+", metavar="DOF",
                    help="degrees of freedom of the model to keep (default: those that the records measure, else all); "
                         "behind one that is no rigid-body mode its unit may stand: flap=rad")


def record_options(to: argparse.ArgumentParser) -> None:
    """Add how records are read."""
    to.add_argument("--ignore", action="append", default=[], metavar="COLUMN",
                    help="a column of the records to leave out (may be repeated)")
    to.add_argument("--degrees", nargs="+", default=(), metavar="COLUMN",
                    help="columns of the records that are in degrees: Roll")
    to.add_argument("--kind", choices=KINDS, help="of the records, where their files do not say it")


def seed_argument(to: argparse.ArgumentParser) -> None:
    """Add --seed."""
    to.add_argument("--seed", type=whole, default=0, help="seed of all randomness (default: 0)")


def tolerance_argument(to: argparse.ArgumentParser) -> None:
    """Add --tolerance."""
    to.add_argument("--tolerance", default=None, metavar="T",
                    help="relative tolerance of mass, stiffness, A_inf, kernel and force (default: what the file "
                         "states, else 0.02), or by name: kernel=0.1,force=0.05")


def whole(text: str, least: int = 0) -> int:
    """Read a seed, or a number of workers."""
    if not text.strip().lstrip("+-").isdecimal() or int(text) < least:
        raise argparse.ArgumentTypeError(f"{text!r}; a whole number is needed, {least} or more")
    return int(text)


def zero_rule(text: str) -> str | float:
    """Read --at-zero: a word or a number."""
    try:
        return text if text in ("free", "zero") else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; choose free, zero or a number [kg/s]") from None


def script(top: argparse.ArgumentParser, shell: str) -> str:
    """Return the completion script of a parser with verbs."""
    verbs = next(a for a in top._actions if isinstance(a, argparse._SubParsersAction)).choices
    cases = "\n".join(f'    */{name}) words="{" ".join(sorted(words(one)))}" ;;' for name, one in verbs.items())
    text = BASH.format(verbs=" ".join(verbs), cases=cases)
    return text if shell == "bash" else f"autoload -U +X bashcompinit && bashcompinit\n{text}"


def words(one: argparse.ArgumentParser) -> set[str]:
    """Return the options of a verb and the words that it chooses from."""
    found = {option for action in one._actions for option in action.option_strings if option.startswith("--")}
    return found | {str(choice) for action in one._actions for choice in action.choices or ()}
