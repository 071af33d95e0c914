"""What came out of a study, a fabric a row: ``tables/summary.csv``, which ends every run on the screen.

Of each test that condition is taken which is nearest to a KES tester's: the model that solves for
equilibrium before the kinematic one, with friction before without.
"""

import numpy as np

from knitsim.kes.curl import is_none
from knitsim.stages.calibration_tables import ROUGHLY, grade
from knitsim.store.reader import opened, stopped
from knitsim.store.results import DIRECTIONS
from knitsim.store.tensile import counted_error
from knitsim.store.timing import write_csv
from knitsim.study.trade import far_from_stated
from knitsim.units import from_si

LOAD = "50 gf/cm"  # the largest force of a tensile test of a knitted fabric
# Columns of each direction: kind of the test, KES parameter, column of the table.
READ = (
    ("tensile", f"EMT {LOAD}", "strain_at_50_gf_per_cm_percent"),
    ("tensile", f"residual_strain {LOAD}", "residual_strain_percent"),
    ("bending", "B", "B_gf_cm2_per_cm"),
    ("bending", "2HB", "2HB_gf_cm_per_cm"),
    ("bending", "M0", "curl_moment_gf_cm_per_cm"),
)
SPACINGS = ("wale_spacing", "course_spacing")
LOUD = 20.0  # per cent of numerical error above which nothing should be built on a test
COLUMNS = (
    "fabric", "yarn",
    *(f"{state}{name}_mm" for name in SPACINGS for state in ("stated_", "rest_")),
    "rest_mass_per_area_g_per_m2",
    *(f"{name}_{direction}" for _, _, name in READ for direction in DIRECTIONS),
    *(f"force_at_{what}_{d}" for d in DIRECTIONS for what in ("largest_strain_gf_per_cm", "percent")),
    "largest_numerical_error_percent", "condition", "measured", "left_out", "stopped",
    "note",
)  # fmt: skip
_FIRST = ("kes", "friction")  # names of the default conditions with friction


def write_summary(study, results, kes, path):
    """Write the table of a Study from its result files and those of its KES parameters."""
    rows = {name: _stated(fabric) for name, fabric in study.fabrics.items()}
    for dataset in opened(results):
        row = rows.get(dataset.attrs["fabric"])
        if row is None:
            continue
        kind, model = dataset.attrs["kind"], dataset.attrs["model"]
        if kind == "measured":
            row["measured"].append(_agreement(dataset))
        if kind == "relaxed":
            for name in SPACINGS:
                row[f"rest_{name}_mm"] = f"{1e3 * float(dataset[name]):.4g}"
            apart = 100.0 * float(dataset["spacing_error"])
            if not apart <= LOUD:
                known = f"up to {apart:.2g} %" if np.isfinite(apart) else "not known"
                row["stopped"].append(f"at rest: the numerical error of its spacings is {known}")
            row["rest_mass_per_area_g_per_m2"] = f"{1e3 * float(dataset['areal_mass']):.4g}"
            row["note"] += far_from_stated(
                study.fabrics[row["fabric"]], *map(dataset.get, SPACINGS)
            )
        if (
            model == "equilibrium"
            and "numerical_error" in dataset
            and kind in ("tensile", "bending")
        ):
            _worst(row, dataset)
        if kind == "tensile":
            _largest(row, dataset)
        if dataset.attrs.get("jammed"):
            row["note"].append(f"at rest: {dataset.attrs['jammed']}")
        for said in ("stop_reason", "not_stable"):
            if dataset.attrs.get(said):
                where = f"{model} {kind} {dataset.attrs['direction']}".strip()
                row["stopped"].append(f"{where}: {dataset.attrs[said]}")
    for dataset in opened(kes):
        _read(rows[dataset.attrs["fabric"]], dataset)
        _without_noise(rows[dataset.attrs["fabric"]])
    for about, why in stopped(results):
        # A yarn that was stopped stops every fabric of it.
        for name, row in rows.items():
            if about["fabric"] == name or (not about["fabric"] and row["yarn"] == about["yarn"]):
                what = about["title"].partition(" of ")[0]
                row["stopped"].append(f"{what} {about['direction']}".strip() + f": {why}")
    for row in rows.values():
        if not (row["model"] or row["condition"] or row["left_out"] or row["stopped"]):
            row["left_out"].append("its scene has no tension or bending test")
        for name in ("left_out", "stopped", "condition", "measured", "note"):
            row[name] = "; ".join(dict.fromkeys(row[name]))
    write_csv(path, COLUMNS, list(rows.values()))


def _stated(fabric):
    row = dict.fromkeys(COLUMNS, "") | {"fabric": fabric.name, "yarn": fabric.yarn.name}
    row |= {"left_out": [], "stopped": [], "condition": [], "measured": [], "model": {}, "note": []}
    for name, spacing in zip(SPACINGS, fabric.stated_spacings, strict=True):
        if spacing is not None:
            row[f"stated_{name}_mm"] = f"{1e3 * spacing:.5g}"
    return row


def _agreement(dataset):
    """How far the model is from each measured curve, with the inputs of one calibration."""
    told = []
    for curve, role, rms, mean in zip(
        *(dataset[n].values for n in ("curve", "curve_role", "misfit_rms", "misfit_mean")), strict=True
    ):  # fmt: skip
        if not np.isfinite(rms):
            told.append(f"{curve} not reached")
        elif rms <= ROUGHLY:
            told.append(f"{curve} {role}, {100.0 * rms:.3g} % rms")
        else:  # a fit that is none is no calibration
            how = "does NOT FIT" if role == "fitted" else role
            told.append(f"{curve} {how}, {grade(float(rms), float(mean))}")
    return f"{dataset.attrs['calibration']}: {', '.join(told)}"


def _worst(row, dataset):
    """The largest error that counts; one that is not known, or too large to build on, is said aloud."""
    along = "curvature" if "curvature" in dataset.coords else "strain"
    value = dataset["moment_per_width" if along == "curvature" else "force_per_width"]
    where = f"{dataset.attrs['kind']} {dataset.attrs['direction']}"
    for name in dataset.variant.values:
        got = [a.sel(variant=name).values if "variant" in a.dims else a.values
               for a in (value, dataset[along], dataset["segment"], dataset["numerical_error"])]  # fmt: skip
        reached = np.isfinite(got[0])
        error = counted_error(*(column[reached] for column in got))
        if not np.isfinite(error).all():
            row["stopped"].append(f"{where}, {name}: its numerical error is not known")
        known = 100.0 * np.max(error[np.isfinite(error)], initial=0.0)
        if known > LOUD:
            row["stopped"].append(f"{where}, {name}: its numerical error is up to {known:.2g} %")
        before = float(row["largest_numerical_error_percent"] or 0.0)
        row["largest_numerical_error_percent"] = f"{max(before, known):.3g}"


def _largest(row, dataset):
    """The largest strain that a test was asked for, and the force there; equilibrium comes first."""
    direction, model = dataset.attrs["direction"], dataset.attrs["model"]
    if row["model"].get(direction) == "equilibrium" and model != "equilibrium":
        return
    strain, force = dataset["strain"].values, dataset["force_per_width"]
    force = force.isel(variant=0).values if "variant" in force.dims else force.values
    strain = dataset["strain"].isel(variant=0).values if strain.ndim > 1 else strain
    held = np.isfinite(strain) & np.isfinite(force)
    if held.any():
        at = int(np.argmax(np.where(held, strain, -np.inf)))
        row["model"][direction] = model
        row[f"force_at_largest_strain_gf_per_cm_{direction}"] = (
            f"{from_si(float(force[at]), 'gf_per_cm'):.4g}"
        )
        row[f"force_at_percent_{direction}"] = f"{100.0 * float(strain[at]):.4g}"


def _read(row, dataset):
    """Take the KES parameters of one fabric from its dataset."""
    names = ("test", "model", "direction", "variant", "kes_parameter", "kes_value", "left_out")
    rows = [
        dict(zip(names, values, strict=True))
        for values in zip(*(dataset[name].values for name in names), strict=True)
    ]
    for kind, parameter, column in READ:
        for direction in DIRECTIONS:
            found = [
                one for one in rows
                if (one["test"], one["direction"], one["kes_parameter"]) == (kind, direction, parameter)
            ]  # fmt: skip
            known = [one for one in found if np.isfinite(one["kes_value"])]
            if known:
                one = min(known, key=_rank)
                row[f"{column}_{direction}"] = f"{one['kes_value']:.4g}"
                row["condition"].append(f"{kind} {direction}: {one['model']}, {one['variant']}")
            elif found:
                row["left_out"].append(
                    f"{parameter.replace('_', ' ')} {direction}: {min(found, key=_rank)['left_out']}"
                )


def _without_noise(row):
    """A curl that is the solver's error is told as none."""
    for direction in DIRECTIONS:
        moment, rigidity = (
            row[f"{name}_{direction}"] for name in ("curl_moment_gf_cm_per_cm", "B_gf_cm2_per_cm")
        )
        if moment and rigidity and is_none(float(moment), float(rigidity)):
            row[f"curl_moment_gf_cm_per_cm_{direction}"] = "0"


def _rank(one):
    variant = one["variant"]
    place = _FIRST.index(variant) if variant in _FIRST else len(_FIRST)
    return one["model"] != "equilibrium", place
