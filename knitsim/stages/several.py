"""The stages that one job does for one yarn or fabric.  What cannot be computed costs no other result:
its file says why, and the tables and figures say it again.
"""

import sys
import traceback
from importlib import import_module

import xarray as xr

from knitsim.errors import ComputationError, InputError
from knitsim.stages.described import describe_stage
from knitsim.stages.laws import FORMS, law_from
from knitsim.store.timing import COLUMNS, write_csv
from knitsim.store.writer import write


def laws_in(path):
    """TensionLaw by form from the result file of a yarn.  Raises ComputationError if it was stopped."""
    with xr.open_dataset(path, engine="netcdf4") as yarn:
        if "stopped" in yarn.attrs and "law_strain" not in yarn:
            raise ComputationError(f"yarn {yarn.attrs['yarn']}: {yarn.attrs['stopped']}")
        return {form: law_from(yarn, form) for form in FORMS}


def run(given, tests, outputs, timings_path, *, yarn=None, log=None):
    """Do the ``tests`` of a YarnInput or FabricInput and write their result files.

    tests: (stage, direction or name of a calibration, or "") of each; outputs: their files; yarn: the
    result file of the yarn, or None; log: a file where tracebacks go, or None.  A refused or failed
    test gets a file without numbers whose attribute ``stopped`` says why.
    """
    rows = []
    for (stage, label), output in zip(tests, outputs, strict=True):
        try:
            laws = [] if yarn is None or stage == "loop" else [laws_in(yarn)]
            module = import_module(f"knitsim.stages.{stage}")
            dataset, timings = module.run(given, *laws, *([label] if label else []))
            rows += timings.rows
        except (OSError, MemoryError):
            raise  # nothing that belongs to this test: to be tried again
        except Exception as error:
            why = _reason(error)
            dataset = stopped(given, stage, label, why)
            what = f"{stage} {label}".strip()
            print(
                f"knitsim: {given.file}: {given.name}, {what}: stopped: {why}",
                file=sys.stderr, flush=True,
            )  # fmt: skip
            if log is not None:
                with open(log, "a", encoding="utf-8") as file:
                    file.write(traceback.format_exc())
        write(dataset, output)
    write_csv(timings_path, COLUMNS, rows)


def _reason(error):
    text = " ".join(str(error).split())
    if isinstance(error, (InputError, ComputationError)):
        return text
    return f"a fault of the program, {type(error).__name__}: {text}"


def stopped(given, stage, label, why):
    """Dataset of a test that has no result: labels, configuration and the reason, no numbers."""
    kind = "calibration" if stage == "calibration" else "direction"
    labels = {kind: label} if label else {}
    return describe_stage(
        xr.Dataset(attrs={"stopped": why}), given, stage, title=f"{stage} of {given.name}: stopped",
        summary=why, references=(), **labels,
    )  # fmt: skip
