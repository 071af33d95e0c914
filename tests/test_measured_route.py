"""A measured curve goes from its file to its prediction figure through few modules, as one type."""

import shutil
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml

from knitsim.figures import measured as figures
from knitsim.figures import style
from knitsim.measured.test import MeasuredTest
from knitsim.stages import calibration as stage
from knitsim.stages.laws import ledger_laws
from knitsim.store.sheet import Sheet
from knitsim.store.writer import write
from knitsim.study.study import load_study

CONFIG = Path(__file__).parents[1] / "config"
PACKAGE = Path(stage.__file__).parents[1]
MOST = 12  # modules from the reader to the figure, what lies below all rooms left out
FOUNDATION = {"units.py", "errors.py", "files.py", "provenance.py"}
POINTS = 37
STRAIN = np.linspace(0.0, 0.2, POINTS)
FORCE = 0.1 * STRAIN + STRAIN**2  # N/mm
MARK = "0.027137"  # a number of the file


def measured(values):
    """Whether an array (n,) is the strain or force of the curve, in any unit, at all or most points."""
    if values.size not in (POINTS, POINTS - 1) or values.dtype.kind != "f":
        return False
    if not values[-1] or not np.isfinite(values).all():
        return False
    return any(
        np.allclose(values / values[-1], (curve / curve[-1])[-values.size :], atol=1e-3)
        for curve in (STRAIN, FORCE)
    )


class Route:
    """The modules of knitsim whose functions are given the curve while this is entered."""

    def __init__(self):
        self.modules, self.calls = {}, Counter()

    def __enter__(self):
        sys.setprofile(self.called)
        return self

    def __exit__(self, *_):
        sys.setprofile(None)

    def called(self, frame, event, _):
        code = frame.f_code
        if event != "call" or not code.co_filename.startswith(str(PACKAGE)):
            return
        module = Path(code.co_filename).relative_to(PACKAGE).as_posix()
        # A function that was never given the curve in fifty calls is taken for one that is not.
        if module in self.modules or module in FOUNDATION or self.calls[code] > 50:
            return
        self.calls[code] += 1
        # A result is given to some for its labels; it carries the curve to those that read or store it.
        words = (*code.co_names, *(one for one in code.co_consts if isinstance(one, str)))
        self.reads = any(word.startswith("measured_") or word == "to_netcdf" for word in words)
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        for name in names:
            value = frame.f_locals.get(name)
            if self.carries(value):
                self.modules[module] = f"{code.co_qualname}({name})"
                return

    def carries(self, value, depth=2):
        if isinstance(value, MeasuredTest | Sheet):
            return True
        if isinstance(value, str | bytes):
            return (MARK if isinstance(value, str) else MARK.encode()) in value
        if isinstance(value, np.ndarray):
            return value.ndim == 1 and measured(value)
        if isinstance(value, xr.Dataset):
            return self.reads and "measured_strain" in value
        if depth == 0 or isinstance(value, type):
            return False
        if isinstance(value, list | tuple):
            return len(value) <= 1000 and any(self.carries(one, depth - 1) for one in value)
        if isinstance(value, dict):
            return any(self.carries(one, depth - 1) for one in list(value.values())[:100])
        own = getattr(value, "__dict__", None)
        return own is not None and any(self.carries(one, depth - 1) for one in list(own.values()))


@pytest.mark.slow
def test_a_curve_reaches_its_prediction_figure_through_few_modules(tmp_path):
    shutil.copytree(CONFIG / "small", tmp_path, dirs_exist_ok=True)
    rows = [f"{e:.6f},{f:.6f}" for e, f in zip(STRAIN, FORCE, strict=True)]
    rows[22] = f"{STRAIN[22]:.6f},{MARK}"
    (tmp_path / "wale.csv").write_text("strain,force_per_width_N_per_mm\n" + "\n".join(rows) + "\n")
    yarns = tmp_path / "yarns.yaml"
    yarns.write_text(yarns.read_text() + "  friction: 0\n")
    fabrics = yaml.safe_load((tmp_path / "fabrics.yaml").read_text())
    fabrics["small"] |= {
        "measured": {"wale": {"direction": "wale", "file": "wale.csv"}},
        "calibrations": {"rigidity": {"fit": ["wale"], "free": ["bending_rigidity"]}},
        "prediction": {"states": 5, "max_curvature_per_cm": 0},
    }
    (tmp_path / "fabrics.yaml").write_text(yaml.safe_dump(fabrics, sort_keys=False))
    small = load_study(tmp_path).fabrics["small"]
    laws = {"continuous": ledger_laws(small.yarn)["continuous"]}
    with Route() as route:
        dataset, _ = stage.run(small, laws, "rigidity")
        write(dataset, tmp_path / "rigidity.nc")
        with xr.open_dataset(tmp_path / "rigidity.nc") as opened, style.context():
            figures.fig31_prediction({"rigidity": opened.load()})
    print("\n".join(f"{module}: {call}" for module, call in sorted(route.modules.items())))
    assert {"store/sheet.py", "measured/read.py", "figures/measured.py"} <= set(route.modules)
    assert len(route.modules) <= MOST, route.modules
