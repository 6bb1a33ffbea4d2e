"""Every file that is read but the coefficients of `hydro_fuzz_targets`: one of each form, written by the package.

Records, radiation models, excitation models, corrections, whole models, offsets, checkpoints, studies, blind runs.
"""

import json

import numpy as np
from fuzz_mutations import (
    COLUMNS,
    CSV,
    HDF5,
    JSON,
    MAT,
    NPZ,
    PARQUET,
    numbers_of_json,
    numbers_of_npz,
    numbers_of_parquet,
)
from fuzzing import Target, arrays_digest, numbers_of_bytes, numbers_of_text
from plant_bodies import coupled_fit, tank_model

import radiation_ss as rss
from benchmarks.heave_tank import sea_record, start
from radiation_ss.blind import generate, read_run
from radiation_ss.effects import activate
from radiation_ss.filter import read_arrays, write_arrays
from radiation_ss.hydro import read_section
from radiation_ss.simulation import Corrected, read_corrected

TIME = np.round(np.arange(0.0, 3.0, 0.1), 10)
RECORD = rss.Record(TIME, {"Heave": np.sin(TIME), "Heave_force": np.where(TIME > 1.0, np.nan, np.cos(TIME))},
                    kind="forced", name="größe 7", speed=1.25, meta={"tank": "north, wall"})


def of_record(record):
    return arrays_digest(record.time, (record.kind, record.name, record.start, record.speed, *record.meta.items(),
                                       *record.channels), *record.channels.values())


def numbers_of_record(record):
    return np.concatenate([record.time, *record.channels.values(), [record.speed]])


def of_fit(fit):
    return arrays_digest(fit.a, fit.b, fit.c, fit.A_inf, (fit.dofs, fit.order, fit.at_zero, fit.points, fit.blocks,
                                                          repr(fit.relative_error)))


def numbers_of_fit(fit):
    parts = [fit.a, fit.b, fit.c, *([] if fit.A_inf is None else [fit.A_inf]), np.array([float(fit.order)])]
    return np.concatenate([np.ravel(part) for part in parts])


def of_model(model):
    return arrays_digest(model.M, model.C, model.D, model.A_inf, model.fit.a, model.fit.b, model.fit.c,
                         (model.dofs, model.name, tuple(model.tolerance.items())))


def of_correction(found):
    return arrays_digest((tuple(found.nominal.items()), tuple(found.tolerance.items()), tuple(found.motion.items()),
                          tuple((a.name, a.dof, a.other, *a.values.items()) for a in found.effects)))


def numbers_of_correction(found):
    return np.array([*found.nominal.values(), *found.tolerance.values(), *(v for a in found.effects
                                                                           for v in a.values.values()),
                     *(v for pair in found.motion.values() for v in pair)])


def of_values(arrays):
    return arrays_digest(tuple(arrays), *arrays.values())


def records():
    """Return the forms of a record."""
    def written(name):
        def write(folder):
            rss.write_record(RECORD, folder / name)
            return folder / name
        return write

    seen = {"values": numbers_of_record, "digest": of_record, "read": rss.read_record}
    return [Target("record .csv", written("run.csv"), "run.csv", own=CSV, pool=numbers_of_text, **seen),
            Target("record .csv.gz", written("run.csv.gz"), "run.csv.gz", text=False, sealed=True, digest=of_record,
                   read=rss.read_record),
            Target("record .parquet", written("run.parquet"), "run.parquet", text=False, own=PARQUET,
                   pool=numbers_of_parquet, **seen)]


def fits():
    """Return the forms of a radiation model, and of an excitation model."""
    fit = tank_model().fit
    six = coupled_fit(("Surge", "Heave"))

    def written(name, what):
        return lambda folder: what.write(folder / name)

    seen = {"digest": of_fit, "read": rss.read_fit, "values": numbers_of_fit}

    def npz(folder):
        np.savez(folder / "fit.npz", A=fit.a, B=fit.b, C=fit.c, dofs=np.array(fit.dofs), order=fit.order)
        return folder / "fit.npz"

    return [Target("fit .json", written("fit.json", fit), "fit.json", own=JSON, pool=numbers_of_json, **seen),
            Target("fit .ss", written("fit.ss", six), "fit.ss", own=COLUMNS, pool=numbers_of_text, **seen),
            Target("fit .h5", written("fit.h5", six), "fit.h5", text=False, own=HDF5, digest=of_fit, read=rss.read_fit),
            Target("fit .mat", written("fit.mat", fit), "fit.mat", text=False, own=MAT, pool=numbers_of_bytes, **seen),
            Target("fit .npz", npz, "fit.npz", text=False, own=NPZ, pool=numbers_of_npz, **seen),
            excitation_target()]


def excitation_target():
    """Return the target of OpenFAST's .ssexctn."""
    data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 12)).select("Heave")
    made = rss.fit_excitation(data, data.directions[0], states=4)

    def digest(found):
        return arrays_digest(found.a, found.b, found.c, (found.dofs, found.lead, found.direction))

    def values(found):
        return np.concatenate([found.a.ravel(), found.b.ravel(), found.c.ravel(), [found.lead]])

    return Target("excitation .ssexctn", lambda folder: made.write(folder / "x.ssexctn"), "x.ssexctn",
                  rss.read_excitation, digest, own=COLUMNS, values=values, pool=numbers_of_text)


def models():
    """Return whole models, corrections of them, and offsets of a section."""
    model = tank_model().replace(name="tank", tolerance={"mass": 0.03})
    found = Corrected({("nominal_inertia", "Heave"): 0.03, ("nominal_kernel", "Heave"): 0.05},
                      activate([("quadratic_drag", {"coefficient": 60.0})], model.dofs), {"mass": 0.03},
                      {"Heave": (0.02, 7.0)})

    def write_model(folder):
        model.write(folder / "model.nc")
        return folder / "model.nc"

    def write_correction(folder):
        found.write(folder / "corrected.json")
        return folder / "corrected.json"

    def write_offsets(folder):
        (folder / "section.csv").write_text("y,z\n0,-1.5\n0.9,-1.4\n1.25,-0.75\n1.5,0\n")
        return folder / "section.csv"

    def of_section(section):
        return arrays_digest(*(arc.curve(np.linspace(0.0, 1.0, 7)) for arc in section.arcs))

    def corners(section):
        ends = np.concatenate([arc.curve(np.array([0.0, 1.0])) for arc in section.arcs])
        return np.round(np.concatenate([ends.real, ends.imag]), 12)

    return [Target("model .nc", write_model, "model.nc", rss.read_model, of_model, text=False, own=HDF5),
            Target("corrected.json", write_correction, "corrected.json", lambda path: read_corrected(path, model),
                   of_correction, own=JSON, values=numbers_of_correction, pool=numbers_of_json),
            Target("offsets .csv", write_offsets, "section.csv", read_section, of_section, own=COLUMNS, values=corners,
                   pool=numbers_of_text)]


def states():
    """Return checkpoints and studies."""
    def write_checkpoint(folder):
        filter_ = rss.DualEnKF(start(0), n_ensemble=10).prepare(sea_record(0, duration=1.0)[0])
        filter_.step({"time": 0.0, "Heave": 1e-3})
        filter_.save(folder / "filter.npz")
        return folder / "filter.npz"

    def write_chunk(folder):
        write_arrays(folder / "chunk-000000.npz", {"draw": np.arange(12.0).reshape(4, 3)})
        return folder / "chunk-000000.npz"

    def write_study(folder):
        rss.repeat(draw, 4, chunk=2, folder=folder)
        return folder

    return [Target("checkpoint", write_checkpoint, "filter.npz", lambda path: rss.DualEnKF.load(path).engine.arrays(),
                   of_values, text=False, own=NPZ, sealed=True),
            Target("chunk of repeat", write_chunk, "chunk-000000.npz", lambda path: read_arrays(path, "a chunk"),
                   of_values, text=False, own=NPZ, sealed=True),
            Target("study.json", write_study, "study.json", lambda folder: rss.repeat(draw, 4, chunk=2, folder=folder),
                   of_values, own=JSON, sealed=True)]


def draw(seed):
    return {"draw": np.random.default_rng(seed).standard_normal(3)}


def blind():
    """Return the files of a blind run that is scored."""
    from radiation_ss.blind import predictions, sealed_folder

    def write(folder):
        place = folder / "run"
        generate(place, 1, 3, kinds=("decays",), groups=("none",), bodies=("heave",))
        case, out = place / "cases" / "000", place / "answers" / "000"
        out.mkdir(parents=True)
        model = rss.read_model(case / "MODEL.nc")
        Corrected({}, ()).write(out / "corrected.json")
        answer = {"seconds": 1.5, "predictions": predictions(model, out / "corrected.json",
                                                             rss.read_record(case / "unseen.csv"))}
        (out / "answer.json").write_text(json.dumps(answer))
        verdict = {"status": "no_gap", "effects": [], "probability": 0.9, "indistinguishable": []}
        (out / "report.json").write_text(json.dumps({"verdict": verdict}))
        assert sealed_folder(place).is_dir()
        return place

    def digest(cases):
        return arrays_digest(tuple((c.status, c.alone, c.within, tuple(sorted(c.gaps.items())), c.seconds, c.group)
                                   for c in cases))

    return [*(Target(f"blind {name.rsplit('/', 1)[-1]}", write, name, read_run, digest, own=JSON) for name in (
        "run/blind.json", "run/answers/000/answer.json", "run/answers/000/report.json")),
        Target("blind labels.json", write, "run-sealed/labels.json", read_run, digest, text=False, sealed=True)]


def targets():
    """Return one target for each form."""
    return [*records(), *fits(), *models(), *states(), *blind()]
