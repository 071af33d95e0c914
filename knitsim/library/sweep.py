"""Many fabrics: each relaxed and tested, in processes, into one dataset with the dimension ``fabric``."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from knitsim import units
from knitsim.errors import ComputationError, InputError
from knitsim.files import replacing
from knitsim.library.design import Design, design_of
from knitsim.library.kes import kes
from knitsim.library.rest import relax
from knitsim.library.tests import Test
from knitsim.provenance import source_hash
from knitsim.store.results import labels_of
from knitsim.store.schema import PHASES
from knitsim.store.writer import describe, to_json, with_attributes
from knitsim.study.study import Fabric

MODULE = "knitsim.library.sweep"
OF_REST = ("wale_spacing", "course_spacing", "kc", "kw", "spacing_error")
# What is kept of every state of a test, where its dataset has it.
OF_STATES = (
    "strain", "curvature", "shear_angle", "force_per_width", "moment_per_width", "transverse_strain",
    "transverse_force_per_width", "wale_spacing", "course_spacing", "dissipated", "numerical_error", "cycle",
)  # fmt: skip
ALONG = ("strain", "curvature", "shear_angle", "cycle")
BATCHES = 8  # for each process, so that none waits long for the others
MOST_IN_BATCH = 32
FEW = 4  # fabrics for which no processes are started

Row = dict[str, Any]


def sweep(
    fabric: Fabric, *, tests: Sequence[Test] = (), table: str | Path | pd.DataFrame | None = None,
    samples: int | None = None, seed: int = 0, vary: Mapping[str, Any] | None = None,
    file: str | Path | None = None, processes: int | None = None, progress: bool = True, **lists: Any,
) -> xr.Dataset:  # fmt: skip
    """Relax and test many fabrics: a dataset with the dimension ``fabric``.

    lists: values of keys of the fabric or its yarn, ``loop_length_mm=[2.8, 2.9], friction=[0.1, 0.2]``; every
    combination is a fabric.  samples: instead, so many fabrics of a Latin hypercube between the two values
    given for each key, by ``seed``.  table: instead, a CSV file or DataFrame with a fabric a row and a key a
    column (``fabric`` or ``name`` names it).  vary: the same as lists, for keys with dots such as
    ``yarn.core_law.core_diameter_mm``.  tests: of each fabric: :class:`knitsim.Pull`, :class:`knitsim.Bend`,
    :class:`knitsim.Shear`, :class:`knitsim.Biaxial`.

    Coordinates: ``fabric``, one for each varied key along it, in its unit, and ``test``.  Variables: those
    of the state at rest, states of tests (fabric, test, step), KES parameters (fabric, test, kes_parameter),
    and ``reason``, not empty where a fabric or one of its tests has no result; there are no numbers then.

    file: a netCDF file for the dataset.  What is done is kept beside it, so that a sweep that was stopped
    goes on where it was; a finished one is read.  processes: how many work, all cores without.

    >>> import knitsim as ks
    >>> fabric = ks.Fabric(ks.Yarn(count_tex=20, bending_rigidity_N_mm2=2e-3), loop_length_mm=2.9)
    >>> many = ks.sweep(fabric, loop_length_mm=[2.8, 3.0], progress=False)
    >>> many["fabric"].values.tolist()
    ['loop_length_mm=2.8', 'loop_length_mm=3']
    >>> many["kc"].round(1).values.tolist()
    [5.3, 5.4]
    """
    if not isinstance(fabric, Fabric):
        raise InputError("sweep.fabric", repr(fabric)[:60], "must be a Fabric")
    tests = tuple(tests)
    for test in tests:
        if not isinstance(test, Test):
            raise InputError("sweep.tests", repr(test)[:60], "must be Pull, Bend, Shear or Biaxial")
    design = design_of({**(vary or {}), **lists}, table, samples, seed)
    identity = _identity(fabric, tests, design)
    path = None if file is None else Path(file)
    if path is not None and path.is_file():
        with xr.open_dataset(path, engine="netcdf4") as done:
            if done.attrs.get("id") == identity:
                return done.load()
    kept = _Kept(path, identity)
    try:
        rows = _rows(fabric, tests, design, kept, processes, progress)
    finally:
        kept.close()
    dataset = _dataset(fabric, tests, design, rows, identity)
    if path is not None:
        with replacing(path) as partial:
            dataset.to_netcdf(partial, engine="netcdf4")
        kept.remove()
    return dataset


def _identity(fabric: Fabric, tests: Sequence[Test], design: Design) -> str:
    content = [fabric.as_dict(), [repr(test) for test in tests], design.names, design.changes]
    text = f"{source_hash(MODULE)} {to_json(content)}"
    return f"sweep/{fabric.name}-{hashlib.sha256(text.encode()).hexdigest()[:16]}"


class _Kept:
    """The rows that are done, one a line in a file beside that of the dataset, if there is one."""

    def __init__(self, path: Path | None, identity: str) -> None:
        self.rows: dict[int, Row] = {}
        self.path = None if path is None else path.with_name(f"{path.name}.part")
        self._file = None
        if self.path is None:
            return
        lines = self.path.read_text("utf-8").splitlines() if self.path.is_file() else []
        if lines and lines[0] == identity:
            for line in lines[1:]:
                try:
                    number, row = json.loads(line)
                except ValueError:
                    break  # cut off where the sweep was stopped
                self.rows[number] = row
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self.path.open("w", encoding="utf-8")
        self._file.write(f"{identity}\n")
        self.add(self.rows)

    def add(self, rows: Mapping[int, Row]) -> None:
        self.rows.update(rows)
        if self._file is not None:
            self._file.writelines(f"{json.dumps([n, row])}\n" for n, row in rows.items())
            self._file.flush()

    def close(self) -> None:
        if self._file is not None:
            self._file.close()

    def remove(self) -> None:
        if self.path is not None:
            self.path.unlink(missing_ok=True)


def _rows(
    fabric: Fabric,
    tests: Sequence[Test],
    design: Design,
    kept: _Kept,
    processes: int | None,
    progress: bool,
) -> list[Row]:
    todo = [n for n in range(len(design)) if n not in kept.rows]
    cores = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    workers = max(1, min(processes or cores, len(todo)))
    told = _Progress(len(design), len(todo), progress)
    # The first here, so that its kernels are compiled once.
    alone = todo[:1] if workers > 1 and len(todo) > FEW else todo
    for n in alone:
        kept.add(_batch(fabric, tests, {n: design.changes[n]}))
        told(kept.rows)
    if alone is not todo:
        told.begin(len(kept.rows))
    rest = todo[len(alone) :]
    if rest:
        size = max(1, min(MOST_IN_BATCH, len(rest) // (BATCHES * workers)))
        batches = [
            {n: design.changes[n] for n in rest[k : k + size]} for k in range(0, len(rest), size)
        ]
        for rows in _in_processes(
            lambda pool, b: pool.submit(_batch, fabric, tests, b), batches, workers
        ):
            kept.add(rows)
            told(kept.rows)
    told.end()
    return [kept.rows[n] for n in range(len(design))]


def _in_processes(
    submit: Callable[[ProcessPoolExecutor, Any], Any], batches: list[Any], workers: int
) -> Iterator[dict[int, Row]]:
    """The results of batches as they come, a few ahead of each process."""
    with ProcessPoolExecutor(workers) as pool:
        waiting = {submit(pool, one) for one in batches[: 2 * workers]}
        ahead = iter(batches[2 * workers :])
        try:
            while waiting:
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
                    waiting |= {submit(pool, one) for one in [next(ahead, None)] if one is not None}
        finally:
            for future in waiting:
                future.cancel()


def _batch(
    fabric: Fabric, tests: Sequence[Test], changes: Mapping[int, dict[str, Any]]
) -> dict[int, Row]:
    return {n: _row(fabric, tests, one) for n, one in changes.items()}


def _row(fabric: Fabric, tests: Sequence[Test], changes: Mapping[str, Any]) -> Row:
    """What is kept of one fabric; numbers in SI, and the reasons for what there is not."""
    row: Row = {"rest": {}, "tests": [{} for _ in tests], "reason": ""}
    try:
        rest = relax(fabric.with_values(changes))
    except (InputError, ComputationError) as error:
        return row | {"reason": str(error)}
    values = [rest.wale_spacing, rest.course_spacing, rest.kc, rest.kw, rest.error]
    row["rest"] = dict(zip(OF_REST, values, strict=True))
    reasons = []
    for number, test in enumerate(tests):
        try:
            result = test.run(rest)
            dataset = result._dataset()
            states = {
                name: dataset[name].values.tolist()
                for name in OF_STATES
                if name in dataset.variables
            }
            states["phase"] = [PHASES.index(one) for one in dataset["phase"].values]
            row["tests"][number] = {"states": states, "kes": _kes(result)}
            if result.stop_reason:
                reasons.append(f"{test!r}: {result.stop_reason}")
        except (InputError, ComputationError) as error:
            reasons.append(f"{test!r}: {error}")
    return row | {"reason": "; ".join(reasons)}


def _kes(result: Any) -> dict[str, tuple[float, str]]:
    try:
        parameters = kes(result).parameters
    except InputError:
        return {}
    return {name: (one.value, one.units) for name, one in parameters.items()}


def _dataset(
    fabric: Fabric, tests: Sequence[Test], design: Design, rows: Sequence[Row], identity: str
) -> xr.Dataset:
    shape = (len(design), len(tests))
    data: dict[str, Any] = {
        name: ("fabric", np.array([row["rest"].get(name, np.nan) for row in rows]))
        for name in OF_REST
    }
    data["reason"] = ("fabric", np.array([row["reason"] for row in rows], dtype=object))
    coords: dict[str, Any] = {"fabric": np.array(design.names, dtype=object)}
    for path, key in design.keys.items():
        values = [one.get(path) for one in design.changes]
        numbers = key.kind in ("number", "integer") and not any(isinstance(v, str) for v in values)
        column = np.array(
            [np.nan if v is None else v for v in values] if numbers
            else ["" if v is None else str(v) for v in values],
            dtype=float if numbers else object,
        )  # fmt: skip
        about = {"long_name": key.about.rstrip(".")} | (
            {"units": units.label(key.unit)} if key.unit else {}
        )
        coords[path.removeprefix("yarn.")] = ("fabric", column, about)
    if tests:
        found = [[row["tests"][k] for k in range(len(tests))] for row in rows]
        coords["test"] = np.array([repr(test) for test in tests], dtype=object)
        _add_states(data, coords, found, shape)
        _add_kes(data, coords, found, shape)
    dataset = xr.Dataset(data, coords)
    config = {"fabric": fabric.as_dict(), "tests": [repr(test) for test in tests]}
    assumed = [row.as_dict() for row in fabric.assumptions()]
    describe(
        dataset, "sweep", labels_of("sweep", fabric.name, fabric.yarn.name),
        title=f"Fabrics that differ from {fabric.name} in {', '.join(design.keys)}",
        summary="Each fabric at rest and tested in the equilibrium model.", references=("munden",),
        configuration=config, assumptions=assumed, modules=[MODULE],
    )  # fmt: skip
    dataset.attrs["id"] = identity
    own = tuple(path.removeprefix("yarn.") for path in design.keys)
    described: xr.Dataset = with_attributes(dataset, own=own)
    return described


def _add_states(
    data: dict[str, Any], coords: dict[str, Any], found: list[list[Row]], shape: Any
) -> None:
    """States of all tests, filled up to the longest with no numbers."""
    steps = [len(one["states"]["phase"]) for row in found for one in row if one]
    size = max(steps, default=0)
    names = [
        name
        for name in OF_STATES
        if any(name in one["states"] for row in found for one in row if one)
    ]
    dims = ("fabric", "test", "step")
    for name in (*names, "phase"):
        out = np.full((*shape, size), np.nan)
        for i, j in np.ndindex(*shape):
            if found[i][j] and name in found[i][j]["states"]:
                values = found[i][j]["states"][name]
                out[i, j, : len(values)] = values
        if name == "phase":
            words = np.array(["", *PHASES], dtype=object)
            coords[name] = (dims, words[np.nan_to_num(out, nan=-1).astype(int) + 1])
        elif name in ALONG:
            coords[name] = (dims, out)
        else:
            # The spacings of states stand beside those at rest.
            data[f"state_{name}" if name in OF_REST else name] = (dims, out)
    coords["step"] = np.arange(size)


def _add_kes(
    data: dict[str, Any], coords: dict[str, Any], found: list[list[Row]], shape: Any
) -> None:
    si: dict[str, str] = {}
    for row in found:
        for one in row:
            si |= {name: unit for name, (_, unit) in one.get("kes", {}).items()}
    out = np.full((*shape, len(si)), np.nan)
    for i, j in np.ndindex(*shape):
        for k, name in enumerate(si):
            out[i, j, k] = found[i][j].get("kes", {}).get(name, (np.nan, ""))[0]
    data["parameter_value"] = (("fabric", "test", "kes_parameter"), out)
    coords["kes_parameter"] = np.array(list(si), dtype=object)
    coords["value_units"] = ("kes_parameter", np.array(list(si.values()), dtype=object))


class _Progress:
    """One line on the terminal: how many are done, how many failed, the time left."""

    EVERY = 0.5  # seconds on a terminal; elsewhere 20 times as rare

    def __init__(self, total: int, todo: int, shown: bool) -> None:
        self.total, self.todo, self.shown = total, todo, shown
        self.begun = self.last = time.monotonic()
        self.first = total - todo

    def begin(self, done: int) -> None:
        """Count the time from here: what came before has compiled."""
        self.begun, self.first = time.monotonic(), done

    def __call__(self, rows: Mapping[int, Row]) -> None:
        now, done = time.monotonic(), len(rows)
        often = self.EVERY if sys.stderr.isatty() else 20 * self.EVERY
        if not self.shown or done == self.first or (now - self.last < often and done < self.total):
            return
        self.last = now
        left = (now - self.begun) / max(done - self.first, 1) * (self.total - done)
        failed = sum(bool(row["reason"]) for row in rows.values())
        what = f"sweep: {done} of {self.total} fabrics, {failed} with a reason, {_clock(left)} left"
        print(f"{what:<70}", end="\r" if sys.stderr.isatty() else "\n", file=sys.stderr, flush=True)

    def end(self) -> None:
        if self.shown and self.todo and sys.stderr.isatty():
            print(file=sys.stderr)


def _clock(seconds: float) -> str:
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60} min {whole % 60:02d} s" if whole < 3600 else f"{whole / 3600:.1f} h"
