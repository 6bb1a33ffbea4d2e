"""What each verb of the command line does."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING, Any

import numpy as np

import radiation_ss as rss
from radiation_ss.atomic import folder_written_whole, written_whole
from radiation_ss.cli.output import check_file, check_folder, progress_bar, say
from radiation_ss.cli.scenario import kept, scenario
from radiation_ss.errors import InputError

if TYPE_CHECKING:
    from radiation_ss.body.model import Model
    from radiation_ss.fit.result import RadiationFit
    from radiation_ss.hydro.data import HydroData
    from radiation_ss.records.record import Record


def demo(args: argparse.Namespace) -> None:
    """Run the tank test from section to page."""
    from radiation_ss.report.demo import run_demo

    check_folder(args.out)
    with progress_bar(args) as tell, folder_written_whole(args.out) as place:
        result = run_demo(place, seed=args.seed, progress=tell)
    say(args, result.summary, f"{result.text}\nLook at {args.out / 'report.html'}")


def check(args: argparse.Namespace) -> None:
    """Report on the quality of hydrodynamic data."""
    check_file(args.out, (".png", ".svg", ".pdf"))
    report = read_hydro_argument(args).check()
    if args.out is not None:
        with written_whole(args.out) as beside:
            report.plot().savefig(beside)
    say(args, report.to_dict(), str(report))


def fit(args: argparse.Namespace) -> None:
    """Fit a radiation model and write it."""
    check_file(args.out)
    data = read_hydro_argument(args)
    if args.dofs:
        data = data.select(args.dofs)
    with progress_bar(args, f"fit of {', '.join(data.dofs)}"):
        made = rss.fit_radiation(data, args.order, points=args.points, at_zero=args.at_zero)
    made.write(args.out)
    assert made.data is not None
    args.notes += [f"{args.hydro}: {note}" for note in made.data.notes[len(data.notes):]]
    args.notes += poor_fit(made, made.data, args.hydro)
    say(args, {"order": made.order, "states": made.states, "stable": made.stable, "passive": made.passive,
               "passivity_margin": made.passivity_margin, "relative_error": made.relative_error,
               "whole_error": made.whole_error, "out": str(args.out)}, f"{made!r}\nwritten: {args.out}")


def model(args: argparse.Namespace) -> None:
    """Make a model from a few numbers and write it."""
    from radiation_ss.body.particulars import ELSEWHERE, Particulars

    check_file(args.out)
    words = {*ELSEWHERE, *(field.name for field in fields(Particulars)), "radiation", "section", "length", "depth"}
    numbers = {ELSEWHERE.get(word, word): value for word, value in vars(args).items()
               if word in words and value is not None}
    if args.dof is not None:
        numbers["dof"], _, unit = args.dof.partition("=")
        numbers["units"] = {numbers["dof"]: unit} if unit else {}
    said = tolerance_of(args.tolerance)
    if not isinstance(said, dict):
        raise InputError(f"--tolerance {args.tolerance}: say of what, for example gyradius=0.1,kernel=0.2")
    tolerance = {ELSEWHERE.get(name, name): value for name, value in said.items()}
    made = rss.body(**numbers, tolerance=tolerance, name=args.name or args.out.stem)
    made.write(args.out)
    say(args, {"out": str(args.out), "dofs": list(made.dofs), "M": made.M.tolist(), "A_inf": made.A_inf.tolist(),
               "C": made.C.tolist(), "D": made.D.tolist(), "tolerance": dict(made.tolerance)},
        f"{made}\nwritten: {args.out}")


def audit(args: argparse.Namespace) -> None:
    """Score a radiation model against data."""
    report = rss.audit(args.radiation_model, read_hydro_argument(args))
    say(args, report.to_dict(), str(report))


def simulate(args: argparse.Namespace) -> None:
    """Predict the motion under a record's force, in a sea or in a decay, and write it."""
    from radiation_ss.simulation.corrected_files import predict_record

    check_file(args.out, (".csv", ".csv.gz", ".parquet"))
    if sum(given is not None for given in (args.record, args.sea, args.decay)) != 1:
        raise InputError("simulate: give a RECORD, --sea HS TP or --decay DOF=X, one of them")
    if args.heading is not None and args.sea is None:
        raise InputError("simulate: --heading is for --sea; a record says where its waves run to by a comment, "
                         "# heading: 90")
    if args.duration is not None and args.record is not None:
        raise InputError("simulate: --duration is for --sea and --decay; a prediction is as long as its record")
    if args.record is not None and os.path.realpath(args.out) == os.path.realpath(args.record):
        raise InputError(f"--out {args.out}: the record itself; the prediction needs another name")
    data = rss.read_hydro(args.model)
    record = None if args.record is None else read_records(args, [args.record], data)[0]
    body = model_of(args, data, [] if record is None else [record], predicts=True)
    with progress_bar(args, f"motion of {body.name}"):
        predicted = scenario(args, body) if record is None else predict_record(body, record, corrected=args.corrected)
    rss.write_record(predicted, args.out)
    say(args, {"out": str(args.out), "samples": int(predicted.time.size)}, f"written: {args.out}")


def identify(args: argparse.Namespace) -> None:
    """Estimate coefficients and force from motion."""
    check_folder(args.out)
    if args.preset is not None and args.method == "spectral":
        raise InputError(f"identify: --preset {args.preset} is of the dual filter; leave out --method spectral")
    method = args.method or "spectral"
    data = rss.read_hydro(args.model)
    records = read_records(args, args.records, data)
    body = model_of(args, data, records)
    given = {"preset": args.preset, "Q_theta": args.q_theta, "Q_state": args.q_state, "Q_force": args.q_force,
             "R": args.r}
    with progress_bar(args, f"identification, {method}"):
        found = rss.identify(body, records, method=method, prior=args.prior, points=args.points, seed=args.seed,
                             **{name: value for name, value in given.items() if value is not None})
    found.save(args.out)
    written = args.out / "identify.json"
    say(args, json.loads(written.read_text(encoding="utf-8")), f"{found}\nwritten: {written}")


def plan(args: argparse.Namespace) -> None:
    """Plan tests from a model alone."""
    check_folder(args.out)
    tolerance, sea = tolerance_of(args.tolerance), None if args.sea is None else tuple(args.sea)
    body = model_of(args, rss.read_hydro(args.model), [], predicts=True)
    with progress_bar(args, "plan of tests"):
        made = rss.plan_tests(body, args.amplitude, args.effects, tolerance, noise=args.noise, sea=sea,
                              tests=args.tests)
    if args.out is not None:
        made.save(args.out)
    say(args, made.to_dict(), str(made) + (f"\nLook at {args.out / 'plan.png'}" if args.out is not None else ""))


def diagnose(args: argparse.Namespace) -> None:
    """Diagnose the sim-to-real gap."""
    check_folder(args.out)
    tolerance = tolerance_of(args.tolerance)
    data = rss.read_hydro(args.model)
    records, withheld = (read_records(args, paths, data) for paths in (args.records, args.withhold))
    body = model_of(args, data, records, predicts=True)
    with progress_bar(args) as tell:
        found = rss.diagnose(body, records, withhold=withheld, tolerance=tolerance, seed=args.seed, progress=tell,
                             effects=args.effects, absent=args.absent or (), present=args.present or ())
    found.save(args.out)
    say(args, found.to_dict(), f"{found}\nLook at {args.out / 'report.html'}")


def blind(args: argparse.Namespace) -> None:
    """Run or score the withheld check."""
    import radiation_ss.blind as check

    result: Any
    if args.step == "run":
        cases = 20 if args.cases is None and not (args.folder / check.MANIFEST).exists() else args.cases
        with ThreadPoolExecutor(args.workers) as executor:
            result = check.run(args.folder, cases=cases, seed=args.seed, mix=args.mix, executor=executor)
    else:
        result = check.score(args.folder)
    say(args, result.to_dict(), str(result))


def read_hydro_argument(args: argparse.Namespace) -> HydroData:
    """Read HYDRO with its options."""
    return rss.read_hydro(args.hydro, args.format, rho=args.rho, depth=args.depth, length=args.length,
                          first_column=args.first_column, vessel=args.vessel, draught=args.draught)


def read_records(args: argparse.Namespace, paths: Sequence[Path], data: HydroData) -> list[Record]:
    """Read records of the degrees of freedom of a model with their options."""
    dofs = dict.fromkeys(data.dofs, "") | kept(args)
    return [carried(args, rss.read_record(path, kind=args.kind, ignore=args.ignore, degrees=args.degrees, dofs=dofs),
                    data) for path in paths]


def carried(args: argparse.Namespace, record: Record, data: HydroData) -> Record:
    """Return the record with the wave elevation at the body, if the comment `probe` says that it is not."""
    from radiation_ss.records.probe import probe_place

    if "wave_elevation" not in record.channels or (place := probe_place(record)) == 0.0:
        return record
    water = f"water of {data.depth:g} m" if np.isfinite(data.depth) else "deep water"
    args.notes.append(f"{record.name}: wave elevation carried from the probe at {place:g} m to the body, in {water}")
    return rss.at_the_body(record, depth=data.depth, g=data.g)


def tolerance_of(text: str | None) -> float | dict[str, float]:
    """Read --tolerance: a number for all, or single ones by name, with commas between; none where it is not given."""
    if text is None:
        return {}
    try:
        if "=" not in text:
            return float(text)
        parts = [part.partition("=") for part in text.split(",")]
        found = {name.strip(): float(value) for name, _, value in parts}
        if len(found) < len(parts):
            raise InputError(f"--tolerance {text}: a name is there twice")
        return found
    except ValueError:
        raise InputError(f"--tolerance {text}: not understood; write 0.02, or kernel=0.1,force=0.05") from None


def model_of(args: argparse.Namespace, data: HydroData, records: Sequence[Record], predicts: bool = False) -> Model:
    """Return the model of the MODEL argument's data, narrowed to the degrees of freedom asked for or measured."""
    from radiation_ss.body.convert import PREDICTION
    from radiation_ss.body.convert import model_of as model_of_file

    measured = [dof for dof in data.dofs if any(dof in record.dofs for record in records)]
    without = args.verb in ("simulate", "plan") and not any(record.dofs for record in records)
    dofs = list(kept(args)) or (data.dofs if without else
                                measured if args.verb == "identify" else data.coupled(measured))
    if not dofs:
        raise InputError(f"{args.model}: its degrees of freedom {list(data.dofs)} are none of those that the records "
                         f"measure, {sorted({dof for record in records for dof in record.dofs})}")
    unseen = ", ".join(dof for dof in dofs if dof not in measured)
    if not args.dofs and measured and unseen:
        args.notes.append(f"{args.model}: {unseen} not measured, but {', '.join(measured)} cannot move alone; if the "
                          f"rig holds the rest, --dofs {join(measured)}")
    if len(dofs) < data.n and not args.dofs:
        left = ", ".join(dof for dof in data.dofs if dof not in dofs)
        args.notes.append(f"{args.model}: {left} not measured by any record and left out (--dofs keeps them)")
    body = model_of_file(data, Path(args.model), args.fit, dofs, args.order, PREDICTION if predicts else None)
    args.notes += [f"{args.model}: {note}" for note in (body.hydro or data).notes[len(data.notes):]]
    if args.fit is None:
        args.notes += poor_fit(body.fit, body.hydro or data, args.model)
    return body


def poor_fit(made: RadiationFit, data: HydroData, source: Path, poor: float = 0.1) -> list[str]:
    """Return a sentence where the radiation model is off the file by a relative error of `poor`, else nothing."""
    error = made.relative_error or 0.0
    if not error > poor:        # of a file that does not state it, NaN
        return []
    cause = ("`radiation-ss check` says what is wrong with these" if data.check().problems else
             f"a check finds no problem in these, and a higher --order than {made.order}"
             f"{'' if made.path else ', or none,'} fits closer")
    whole = error if np.isnan(made.whole_error) else made.whole_error
    return [f"{source}: the fitted radiation model is {whole:.0%} (rms) off the file's coefficients; {cause}"]
