"""Mutations of one file form each, and the numbers that stand in a file by a second, plain reader."""

import io
import json
import random

import numpy as np
from fuzzing import JUNK, numbers_of_text

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
    parts += [part / 100.0 for part, name in zip(parts, found.column_names) if "[cm]" in name]  # as `COLUMNS` writes
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
