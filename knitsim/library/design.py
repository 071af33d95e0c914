"""Which fabrics a sweep is of: all combinations of lists, the rows of a table, or a Latin hypercube."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import qmc

from knitsim.errors import InputError
from knitsim.study.keys import Key
from knitsim.study.resolve import value_label
from knitsim.study.schema import FABRIC, YARN

NAME_COLUMNS = ("fabric", "name")
MOST = 1_000_000
_NOT_VARIED = ("scene", "yarn", "source")


@dataclass(frozen=True)
class Design:
    """names of the fabrics; changes: {path of a key: value} of each; keys: {path: Key} of what varies."""

    names: tuple[str, ...]
    changes: tuple[dict[str, Any], ...]
    keys: dict[str, Key]

    def __len__(self) -> int:
        return len(self.names)


def design_of(
    varied: Mapping[str, Any],
    table: str | Path | pd.DataFrame | None,
    samples: int | None,
    seed: int,
) -> Design:
    """The :class:`Design` that the arguments of :func:`knitsim.sweep` describe.  Raises InputError."""
    if table is not None:
        if varied or samples is not None:
            raise InputError("sweep.table", None, "stands alone: its columns are what varies")
        return _of_table(table)
    if not varied:
        raise InputError(
            "sweep", None, "needs lists of values (loop_length_mm=[2.8, 2.9]) or a table"
        )
    keys = {_path(name): _key(name) for name in varied}
    columns = {_path(name): _values(name, values) for name, values in varied.items()}
    if samples is not None:
        return _hypercube(keys, columns, samples, seed)
    count = int(np.prod([float(len(values)) for values in columns.values()]))
    if count > MOST:
        raise InputError(
            "sweep", count, f"fabrics: must be at most {MOST}; take samples=NUMBER of ranges"
        )
    changes = [
        dict(zip(columns, chosen, strict=True)) for chosen in itertools.product(*columns.values())
    ]
    return Design(tuple(_name(one) for one in changes), tuple(changes), keys)


def _path(name: str) -> str:
    """The key's path as ``with_value`` of a fabric takes it; a key of its yarn needs no ``yarn.``."""
    if "." in name or FABRIC.key(name) is not None:
        return name
    return f"yarn.{name}" if YARN.key(name) is not None else name


def _key(name: str) -> Key:
    section: Any = FABRIC
    parts = _path(name).split(".")
    if parts[0] == "yarn" and len(parts) > 1:
        section, parts = YARN, parts[1:]
    for part in parts[:-1]:
        section = section.section(part) if section is not None else None
    key: Key | None = section.key(parts[-1]) if section is not None else None
    if key is None or parts[-1] in _NOT_VARIED:
        from difflib import get_close_matches

        known = [one.name for one in (*FABRIC.keys, *YARN.keys) if one.name not in _NOT_VARIED]
        near = get_close_matches(parts[-1], known, 1, 0.5)
        right = f"the nearest is {near[0]}" if near else f"keys are: {', '.join(known)}"
        raise InputError(f"sweep.{name}", None, f"is no key of a fabric or yarn; {right}")
    return key


def _values(name: str, values: Any) -> list[Any]:
    if isinstance(values, (str, bytes)) or not isinstance(
        values, (Sequence, np.ndarray, pd.Series)
    ):
        raise InputError(
            f"sweep.{name}", values, "must be a list of values; one value belongs to the fabric"
        )
    found = (
        np.asarray(values).tolist() if isinstance(values, (np.ndarray, pd.Series)) else list(values)
    )
    if not found:
        raise InputError(f"sweep.{name}", "[]", "must hold at least one value")
    return found


def _hypercube(
    keys: dict[str, Key], columns: dict[str, list[Any]], samples: int, seed: int
) -> Design:
    if isinstance(samples, bool) or not isinstance(samples, int) or not 1 <= samples <= MOST:
        raise InputError("sweep.samples", samples, f"must be a whole number from 1 to {MOST}")
    for path, ends in columns.items():
        number = keys[path].kind in ("number", "count") and all(
            isinstance(e, (int, float)) for e in ends
        )
        if not (number and len(ends) == 2 and ends[0] < ends[1]):
            raise InputError(
                f"sweep.{path}", ends, "must be lowest and highest of a number, with samples"
            )
    low, high = np.array(list(columns.values()), dtype=float).T
    unit = qmc.LatinHypercube(len(columns), rng=np.random.default_rng(seed)).random(samples)
    rows = low + unit * (high - low)
    changes = [dict(zip(columns, map(float, row), strict=True)) for row in rows]
    width = len(str(samples))
    return Design(tuple(f"{k:0{width}d}" for k in range(1, samples + 1)), tuple(changes), keys)


def _of_table(table: str | Path | pd.DataFrame) -> Design:
    """A fabric a row; a cell that is empty leaves the fabric's own value."""
    where = "sweep.table"
    if not isinstance(table, pd.DataFrame):
        where = str(table)
        if not Path(table).is_file():
            raise InputError(where, None, "no such file")
        table = pd.read_csv(
            table, sep=None, engine="python", dtype=str, encoding="utf-8-sig", comment="#"
        )
    if not len(table):
        raise InputError(where, None, "must hold one row at least, below the names of the keys")
    named = next((name for name in NAME_COLUMNS if name in table), None)
    keys = {_path(str(name)): _key(str(name)) for name in table if name != named}
    changes = []
    for row in table.to_dict("records"):
        cells = {_path(str(name)): _cell(value) for name, value in row.items() if name != named}
        changes.append({path: value for path, value in cells.items() if value is not None})
    names = [str(name) for name in table[named]] if named else [_name(one) for one in changes]
    if len(set(names)) < len(names):
        names = [f"{k}_{name}" for k, name in enumerate(names, 1)]
    return Design(tuple(names), tuple(changes), keys)


def _cell(value: Any) -> Any:
    """A cell as a key takes it: a number with point or comma, else its text; None where it is empty."""
    if not isinstance(value, str):
        return None if pd.isna(value) else value.item() if isinstance(value, np.generic) else value
    text = value.strip()
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for number in (int, float):
        try:
            return number(text.replace(",", "."))
        except ValueError:
            continue
    return text or None


def _name(changes: Mapping[str, Any]) -> str:
    parts = [
        f"{path.rsplit('.', 1)[-1]}={value_label(value, 0)}" for path, value in changes.items()
    ]
    return ",".join(parts)
