"""Writing result files: names checked against the schema, the same input to the same bytes."""

import errno
import hashlib
import json
import os
import shutil

import numpy as np

import knitsim
from knitsim.files import replacing
from knitsim.provenance import source_hash
from knitsim.store.results import LABELS, RESULTS, path_of
from knitsim.store.schema import (
    CONVENTIONS,
    COORDINATES,
    REFERENCES,
    SCHEMA_VERSION,
    VARIABLES,
)

# Shapes are rounded to seven significant digits (below 1 nm on a loop): files 3 times smaller.
SHAPE_DIGITS = 7
LICENSE = "that of whoever ran the study; knitsim (BSD-3-Clause) claims no right in results"
_SPARE = 2**20  # bytes that a file takes beyond its numbers, at most
_NEEDED = (*LABELS, "title", "source_hash", "configuration", "assumptions")


def to_json(value):
    """JSON of plain data, keys sorted, so that equal data give equal bytes."""
    return json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"))


def describe(
    dataset, stage, labels, *, title, summary, references, configuration, assumptions, modules=None
):
    """``dataset`` with the global attributes that every result file carries (in place).

    stage: of results.RESULTS; labels: as results.labels_of gives them; references: keys of
    schema.REFERENCES; configuration: plain data, the scene's resolved input; assumptions: list of rows
    of the ledger; modules: those whose sources the result depends on, that of the stage if None.
    """
    version = f"knitsim {knitsim.__version__}"
    sources = source_hash(*([f"knitsim.stages.{stage}"] if modules is None else modules))
    configuration = to_json(configuration)
    made = hashlib.sha256(f"{sources} {configuration}".encode()).hexdigest()[:16]
    words = ("weft-knitted fabric", labels["pattern"], RESULTS[stage].keywords)
    dataset.attrs.update(
        title=title,
        summary=summary,
        **labels,
        source=version,
        references="; ".join(REFERENCES[key] for key in references),
        keywords=", ".join(filter(None, words)),
        license=LICENSE,
        creator_name=version,
        # The same for the same input and sources, and for nothing else.
        id=f"{path_of(stage, **labels).removesuffix('.nc')}-{made}",
        naming_authority="knitsim",
        Conventions=CONVENTIONS,
        schema_version=SCHEMA_VERSION,
        knitsim_version=knitsim.__version__,
        source_hash=sources,
        configuration=configuration,
        assumptions=to_json(assumptions),
    )
    return dataset


def with_attributes(dataset, own=()):
    """A copy of ``dataset`` whose variables say their unit, meaning and flags, as the schema has them.

    own: names that the schema does not know and that say it themselves.

    Raises ValueError for a name that the schema does not know.
    """
    dataset = dataset.copy(deep=False)
    for name in dataset.variables:
        if name in own:
            continue
        table = COORDINATES if name in dataset.coords else VARIABLES
        if name not in table:
            raise ValueError(f"'{name}' is not in the result schema")
        entry, variable = table[name], dataset[name].variable
        attributes = {"long_name": entry.long_name}
        if entry.units is not None:
            attributes["units"] = entry.units
        if entry.flags:
            attributes["flag_values"] = np.arange(len(entry.flags), dtype=np.int8)
            attributes["flag_meanings"] = " ".join(entry.flags)
        # A new variable: attributes of the caller's dataset stay as they are.
        dataset[name] = dataset[name].assign_attrs({**variable.attrs, **attributes})
    return dataset


def write(dataset, path):
    """Write an xarray Dataset to the netCDF file ``path``; whole or not at all.

    Raises ValueError for a name that the schema does not know or an attribute that is missing.
    """
    for needed in _NEEDED:
        if needed not in dataset.attrs:
            raise ValueError(f"{path}: attribute {needed} is missing")
    dataset = with_attributes(dataset)
    encoding = {}
    for name in dataset.variables:
        entry = (COORDINATES if name in dataset.coords else VARIABLES)[name]
        variable = dataset[name].variable
        own = encoding[name] = {"_FillValue": None}
        if entry.flags:
            own["dtype"] = "int8"
        if variable.dtype.kind == "f" and variable.size > 64:
            own |= {"zlib": True, "complevel": 4, "shuffle": True}
            if entry.shape:
                own |= {"significant_digits": SHAPE_DIGITS, "quantize_mode": "GranularBitRound"}
    with replacing(path) as partial:
        try:
            dataset.to_netcdf(partial, engine="netcdf4", encoding=encoding)
        except (OSError, RuntimeError) as error:
            # HDF5 does not say why; a full disk is by far the likeliest.
            if shutil.disk_usage(partial.parent).free < dataset.nbytes + _SPARE:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path)) from error
            raise
