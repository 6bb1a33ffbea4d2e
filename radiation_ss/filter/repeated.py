"""Many runs of one study: over seeds, in one process or on any executor, streamed to disk, resumable."""

import hashlib
import json
import pickle
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from radiation_ss.atomic import made_folder, write_whole
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.checkpoint import read_arrays, write_arrays
from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.inference.scales import channels
from radiation_ss.parallel import spread
from radiation_ss.reading import read_json
from radiation_ss.records.record import Record

Task = Callable[[int], Mapping[str, np.ndarray]]
Results = dict[str, np.ndarray]


def repeat(task: Task, runs: int, *, seed: int = 0, executor: Executor | None = None, chunk: int = 10,
           folder: str | Path | None = None, progress: Callable[[int, int], None] | None = None) -> Results:
    """Run a task once for each of many seeds.

    A run's seed depends on `seed` and its number alone, so results are the same to the last bit in one process, on a
    pool of any size, and on a cluster.

    Parameters
    ----------
    task : callable
        Takes a seed, returns named arrays of fixed shapes; must be picklable with `folder`, and where `executor` leaves
        the process. `FilterStudy` is one.
    runs : int
    seed : int
    executor : concurrent.futures.Executor, optional
        Thread or process pool, Dask's `client.get_executor()`, mpi4py.futures; this process if absent. It is not shut
        down.
    chunk : int
        Runs in one job.
    folder : path, optional
        Where finished chunks are written as they come. Called again with the same folder and study, `repeat` does only
        what is missing.
    progress : callable, optional
        Called with (runs done, runs).

    Returns
    -------
    dict of str to ndarray, shape (runs, ...)
        In the order of the runs.

    Raises
    ------
    InputError
        If a folder is given and the task cannot be pickled, the folder holds another study, or its study.json is
        damaged. A damaged chunk is done again, with a warning.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> def largest(seed):
    ...     return {"crest": np.random.default_rng(seed).normal(size=100).max()}
    >>> rss.repeat(largest, runs=3)["crest"].shape
    (3,)
    """
    if runs < 1 or chunk < 1:
        raise InputError(f"runs: {runs}, chunk: {chunk}; both must be at least 1")
    parts = [range(first, min(first + chunk, runs)) for first in range(0, runs, chunk)]
    place = None if folder is None else _opened(Path(folder), task, runs, seed, chunk)
    files = [None if place is None else place / f"chunk-{i:06d}.npz" for i in range(len(parts))]
    done = {i: found for i, file in enumerate(files) if (found := _kept(file)) is not None}
    missing = [i for i in range(len(parts)) if i not in done]
    finished = sum(len(parts[i]) for i in done)
    for at, results in spread(_chunk, ((task, parts[i], seed) for i in missing), executor):
        i = missing[at]
        done[i] = results
        finished += len(parts[i])
        if (file := files[i]) is not None:
            write_arrays(file, results)
        if progress is not None:
            progress(finished, runs)
    return {name: np.concatenate([done[i][name] for i in range(len(parts))]) for name in done[0]}


def run_seed(seed: int, run: int) -> int:
    """Return the seed of one run: 64 bits that depend on the study's seed and the run's number."""
    return int(np.random.SeedSequence(seed, spawn_key=(run,)).generate_state(1, np.uint64)[0])


def _chunk(task: Task, numbers: range, seed: int) -> Results:
    each = [task(run_seed(seed, run)) for run in numbers]
    return {name: np.stack([np.asarray(one[name]) for one in each]) for name in each[0]}


def _opened(folder: Path, task: Task, runs: int, seed: int, chunk: int) -> Path:
    """Return the folder of a study; its manifest says which, so that none is continued with another's runs."""
    try:
        content = pickle.dumps(task)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(f"task: cannot be pickled ({error}), which a folder needs to know its study by; make it a "
                         "function of a module, or leave folder out") from None
    manifest = {"schema": "radiation_ss.repeat/2", "runs": runs, "seed": seed, "chunk": chunk,
                "task": hashlib.sha256(content).hexdigest()}
    path = made_folder(folder) / "study.json"
    if not path.exists():
        write_whole(path, json.dumps(manifest, indent=1))
    found = read_json(path, "description of a study; delete it to go on with the same study, or use an empty folder",
                      dict)
    other = [key for key in manifest if found.get(key) != manifest[key]]
    if other:
        raise InputError(f"{path}: holds another study ({', '.join(other)} differ); use an empty folder")
    return folder


def _kept(path: Path | None) -> Results | None:
    """Return the chunk of a file that is there and whole; warn of one that is damaged."""
    try:
        return None if path is None or not path.exists() else read_arrays(path, "chunk of a study")
    except InputError as error:
        warnings.warn(f"{error}; its runs are done again", RuntimeWarning, stacklevel=3)
        return None


class FilterStudy:
    """The study of Fig. 9 and Table 3: one model, record and filter, many seeds; options as `DualEnKF` takes them."""

    def __init__(self, model: Model, record: Record, **options: object) -> None:
        self.model, self.record, self.options = model, record, options

    def __call__(self, seed: int) -> Results:
        """Return theta and theta_std at the end, force and force_std at the last sample, and whether it diverged."""
        filter_ = DualEnKF(self.model, seed=seed, **self.options).prepare(self.record)  # type: ignore[arg-type]
        sizes = {"theta": filter_.parts.theta.size, "theta_std": filter_.parts.theta.size, "force": self.model.n,
                 "force_std": self.model.n}
        try:
            out = filter_.advance(self.record.time, channels(self.record, self.model.dofs))
        except SolverError:
            return {**{name: np.full(size, np.nan) for name, size in sizes.items()}, "diverged": np.array(True)}
        return {**{name: getattr(out, name)[-1] for name in sizes}, "diverged": np.array(False)}
