"""Every file that is read but the coefficients of `hydro_fuzz_targets`: one of each form, written by the package.

Records, radiation models, excitation models, corrections, whole models, offsets, checkpoints, studies, blind runs.
"""

import io
import json
import random

import numpy as np
from fuzzing import JUNK, Target, arrays_digest, numbers_of_bytes, numbers_of_text
from plant_bodies import coupled_fit, tank_model

import radiation_ss as rss
from benchmarks.heave_tank import sea_record, start
from radiation_ss.blind.answers import read_run
from radiation_ss.blind.runner import generate
from radiation_ss.effects import activate
from radiation_ss.filter.checkpoint import read_arrays, write_arrays
from radiation_ss.hydro.section.offsets import read_section
from radiation_ss.simulation.corrected import Corrected, read_corrected

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


# -- mutations of one form -------------------------------------------------------------------------------------------

WORDS = [None, True, "x", "1.0", "", [], {}, [[]], [1.0], {"a": 1}, -1, 0, 3.7, 10**400, float("nan"), float("inf"),
         "\x00", "9" * 300, ["Heave", "Heave"], [[1.0, "2"], [3.0]]]


def odd_json(content, rng):
    """Change one node of a JSON file to something of another type or size, or lose, rename or double it."""
    tree = json.loads(content)
    places = []

    def walk(node, owner, key):
        if owner is not None:
            places.append((owner, key))
        items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
        for name, child in items:
            walk(child, node, name)

    walk(tree, None, None)
    owner, key = places[rng.integers(len(places))]
    way = rng.integers(6)
    if way == 0:
        del owner[key]
    elif way == 1 and isinstance(owner, dict):
        owner[f"{key}_"] = owner.pop(key)
    elif way == 2 and isinstance(owner, list):
        owner.insert(key, owner[key])
    elif way == 3:
        return json.dumps(tree).replace("}", ', "again": ' + "[" * 100_000, 1).encode()
    elif way == 4:
        owner[key] = [owner[key]]
    else:
        owner[key] = WORDS[rng.integers(len(WORDS))]
    return json.dumps(tree).encode()


def kept_json(content, rng):
    """Write a JSON file with other blanks and another order of the keys."""
    tree = json.loads(content)

    def mixed(node):
        if isinstance(node, dict):
            keys = list(node)
            random.Random(int(rng.integers(2**31))).shuffle(keys)
            return {key: mixed(node[key]) for key in keys}
        return [mixed(item) for item in node] if isinstance(node, list) else node

    tree = mixed(tree) if rng.random() < 0.5 else tree
    return json.dumps(tree, indent=int(rng.integers(0, 5)) or None, ensure_ascii=bool(rng.integers(2))).encode()


def kept_csv(content, rng):
    """Write a CSV with other line ends, blanks, quotes or a byte-order mark."""
    text = content.decode()
    head, _, body = text.partition("\ntime")
    ways = [lambda: text.replace("\n", "\r\n"), lambda: text.replace("\n", "\r"), lambda: "\ufeff" + text,
            lambda: head + "\ntime" + body.replace(",", " , "), lambda: text + "\n\n",
            lambda: head + "\n# made by hand\n\ntime" + body, lambda: text.replace("Heave [m]", '"Heave [m]"')]
    return ways[rng.integers(len(ways))]().encode()


def kept_columns(content, rng):
    """Write a table of numbers with other blanks or line ends."""
    ways = [lambda: content.replace(b"\n", b"\r\n"), lambda: content.replace(b" ", b"  "), lambda: content + b"\n\n",
            lambda: content.replace(b" ", b"\t")]
    return ways[rng.integers(len(ways))]()


def odd_array(values, rng):
    """Return something of another shape or type in the place of an array."""
    values = np.asarray(values)
    if values.dtype.kind not in "fiub":
        return [np.zeros(3), np.array(""), np.array("x" * 200), np.array(["a", "b"])][rng.integers(4)]
    ways = [lambda: values.ravel(), lambda: values[..., None], lambda: np.zeros(0), lambda: np.array("text"),
            lambda: np.full(values.shape, np.nan), lambda: np.array(["a", "b"]), lambda: values.T,
            lambda: np.zeros((3, 5, 7)), lambda: values.astype("f4"), lambda: np.ones(values.shape, bool),
            lambda: values.astype(complex) * 1j if values.dtype.kind in "fiu" else values, lambda: np.array(-1.0),
            lambda: np.repeat(values.ravel(), 2), lambda: np.array(1e300)]
    return ways[rng.integers(len(ways))]()


def odd_hdf5(content, rng):
    """Lose, rename, empty, reshape or retype a data set of an HDF5 or netCDF file, or state a shape beyond memory."""
    import h5py

    raw = io.BytesIO(content)
    with h5py.File(raw, "r+") as file:
        names = []
        file.visit(names.append)
        names = [name for name in names if isinstance(file[name], h5py.Dataset)] or names
        name = names[rng.integers(len(names))]
        old, way = file[name], rng.integers(6)
        if way == 0:
            del file[name]
        elif way == 1:
            file.move(name, f"{name}_")
        elif way == 2:
            value = odd_array(old[()] if old.dtype.kind in "fiu" else np.zeros(3), rng)
            del file[name]
            file[name] = value.astype("S9") if value.dtype.kind == "U" and value.ndim else (
                str(value) if value.dtype.kind == "U" else value)
        elif way == 3:
            del file[name]
            file.create_dataset(name, (10**7, 10**6), "f8", chunks=(1000, 1000))
        elif way == 4:
            del file[name]
            file.create_group(name)
        else:
            old.attrs["units"] = ["deg", "x"] if rng.random() < 0.5 else np.zeros((2, 2))
    return raw.getvalue()


def odd_npz(content, rng):
    """Lose, rename, reshape or retype an array of an .npz."""
    with np.load(io.BytesIO(content)) as file:
        arrays = {name: file[name] for name in file.files}
    name = list(arrays)[rng.integers(len(arrays))]
    value = arrays.pop(name)
    if rng.random() < 0.7:
        arrays[name if rng.random() < 0.7 else f"{name}_"] = odd_array(value, rng)
    raw = io.BytesIO()
    np.savez(raw, **arrays)
    return raw.getvalue()


def odd_mat(content, rng):
    """Lose, rename, reshape or retype a variable of a .mat."""
    from scipy.io import loadmat, savemat

    found = {key: value for key, value in loadmat(io.BytesIO(content)).items() if not key.startswith("__")}
    name = list(found)[rng.integers(len(found))]
    value = found.pop(name)
    if rng.random() < 0.7:
        found[name if rng.random() < 0.7 else f"{name}_"] = odd_array(value, rng) if value.dtype.kind in "fiu" else 3.0
    raw = io.BytesIO()
    savemat(raw, found)
    return raw.getvalue()


def odd_parquet(content, rng):
    """Write a parquet file with a column of another type, another name, or other comments."""
    import pyarrow as pa
    from pyarrow import parquet

    found = parquet.read_table(io.BytesIO(content))
    at, size = int(rng.integers(found.num_columns)), found.num_rows
    columns = [pa.array([True] * size), pa.array(["x"] * size), pa.array([[1.0]] * size), pa.nulls(size),
               pa.array([{"a": 1}] * size), pa.array([2**63 + 1] * size, pa.uint64()), pa.array([b"1"] * size),
               pa.array(np.full(size, np.inf)), pa.array([0] * size, pa.timestamp("s"))]
    names = ["", "time [s]", "Heave [cm]", "[", "Pitch [rad]", "x" * 5000, "größe", "Heave_force [N m]"]
    way = rng.integers(3)
    if way == 0:
        found = found.set_column(at, found.column_names[at], columns[rng.integers(len(columns))])
    elif way == 1:
        found = found.rename_columns([names[rng.integers(len(names))] if k == at else name
                                      for k, name in enumerate(found.column_names)])
    else:
        word = JUNK[rng.integers(len(JUNK))]
        key = [b"kind", b"speed", b"name", b"\xff", b""][rng.integers(5)]
        found = found.replace_schema_metadata({key: word})
    raw = io.BytesIO()
    parquet.write_table(found, raw)
    return raw.getvalue()


def numbers_of_parquet(content):
    from pyarrow import parquet

    try:
        found = parquet.read_table(io.BytesIO(content))
        parts = [np.asarray(column.cast("float64", safe=False)) for column in found.columns]
    except Exception:
        return np.zeros(0)
    text = b" ".join((found.schema.metadata or {}).values())
    return np.concatenate([*parts, numbers_of_text(text)])


def numbers_of_npz(content):
    try:
        with np.load(io.BytesIO(content)) as file:
            parts = [np.ravel(file[name]) for name in file.files if file[name].dtype.kind in "fiub"]
    except Exception:
        return np.zeros(0)
    return np.concatenate([part.astype(float) for part in parts])


def numbers_of_json(content):
    numbers = []

    def walk(node):
        if isinstance(node, bool):
            return
        if isinstance(node, int | float):
            numbers.append(float(node))
        for child in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
            walk(child)

    walk(json.loads(content))
    return np.array(numbers)


JSON = {"keep": kept_json, "odd": odd_json}
CSV = {"keep": kept_csv}
HDF5, NPZ, MAT, PARQUET, COLUMNS = ({"odd": odd_hdf5}, {"odd": odd_npz}, {"odd": odd_mat}, {"odd": odd_parquet},
                                    {"keep": kept_columns})


# -- targets ---------------------------------------------------------------------------------------------------------

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
                   of_values, own={"keep": kept_json, "odd": odd_json}, sealed=True)]


def draw(seed):
    return {"draw": np.random.default_rng(seed).standard_normal(3)}


def blind():
    """Return the files of a blind run that is scored."""
    from radiation_ss.blind.diagnosing import predictions
    from radiation_ss.blind.seal import sealed_folder

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
