"""The tables of the workflow, drawn from result files: run times, assumptions, corrections."""

import csv
from pathlib import Path

import numpy as np
import xarray as xr

from knitsim.store.reader import opened
from knitsim.store.timing import COLUMNS, write_csv

# The paper, section 4: computing time of the whole simulation of one test (s).
PAPER_TIMES = {
    ("kinematic_tension", "course"): 5 * 60.0,
    ("kinematic_tension", "wale"): 8 * 60.0,
    ("kinematic_bending", "course"): 5 * 60.0,
    ("kinematic_bending", "wale"): 5 * 60.0,
}
TIMING_COLUMNS = (*COLUMNS[:-2], "paper_value", *COLUMNS[-2:])
ASSUMPTION_COLUMNS = (
    "subject", "key", "value", "unit", "low", "high", "choices", "because", "largest_effect",
    "effect",
)  # fmt: skip
CORRECTION_COLUMNS = ("where", "printed", "right", "size", "value", "units", "subject")


def timing_table(stage_files, path):
    """Gather the run times of all jobs, with the paper's own beside those of whole tests."""
    rows = []
    for file in stage_files:
        with Path(file).open(newline="", encoding="utf-8") as lines:
            for row in csv.DictReader(lines):
                paper = PAPER_TIMES.get((row["stage"], row["direction"]), "")
                rows.append(row | {"paper_value": paper if row["whole_test"] else ""})
    rows.sort(key=lambda row: tuple(row[name] for name in COLUMNS[:4]))
    write_csv(path, TIMING_COLUMNS, rows)


def _test_of(dataset):
    """What a result file is about, in words: ``kinematic tension, course: `` or nothing."""
    kind, model, direction = (dataset.attrs[name] for name in ("kind", "model", "direction"))
    if not direction:
        return ""
    return f"{model} {'tension' if kind == 'tensile' else kind}, {direction}: "


MANY = 9.0  # relative change from which it is told as a factor


def _effects(files):
    """{(name of the yarn or fabric, path of the key): [(value, effect, text), ...]}.

    effect: relative change; NaN where the alternative was refused, which the text then says.
    """
    found = {}
    for dataset in opened(files):
        name = dataset.attrs["fabric"] or dataset.attrs["yarn"]
        if "quantity" not in dataset.coords:
            continue
        names = [_test_of(dataset) + str(q).replace("_", " ") for q in dataset["quantity"].values]
        effects, refusals = dataset["assumption_effect"].values, dataset["refused"].values
        for label, row, refused in zip(
            dataset["alternative"].values, effects, refusals, strict=True
        ):
            key, _, value = str(label).rpartition("=")
            rows = found.setdefault((name, key), [])
            if refused:
                rows.append((value, np.nan, f"refused: {str(refused).partition(': ')[2]}"))
            for quantity, effect in zip(names, row, strict=True):
                if np.isfinite(effect):
                    # A result near nothing changes by many times itself.
                    changed = (
                        f"{100 * effect:+.3g} %"
                        if abs(effect) < MANY
                        else f"{1 + effect:.3g} times"
                    )
                    text = f"{quantity} {changed}"
                    rows.append((value, effect, text if abs(effect) >= 5e-5 else ""))
    return found


def _effect_columns(row, found):
    """The columns ``largest_effect`` and ``effect`` of one row of the ledger."""
    if not row.path:
        return {"largest_effect": "not varied", "effect": "not varied: no key changes it"}
    if not found:
        return {"largest_effect": "unused", "effect": "used by no test of this study"}
    by_value = {}
    for value, _, text in found:
        by_value.setdefault(value, []).append(text)
    texts = [f"{v}: {', '.join(filter(None, t)) or 'none'}" for v, t in by_value.items()]
    known = [(abs(effect), f"{value}: {text}") for value, effect, text in found if text]
    known = [pair for pair in known if np.isfinite(pair[0])]
    refused = [f"{value}: {text}" for value, effect, text in found if not np.isfinite(effect)]
    largest = max(known)[1] if known else refused[0] if refused else "below 0.005 %"
    return {"largest_effect": largest, "effect": "; ".join(texts)}


def assumption_table(study, result_files, path):
    """Write the ledger of the Study with the effects that the result files hold."""
    effects = _effects(result_files)
    rows = []
    for row in study.assumptions():
        found = []
        for group in (study.yarns, study.fabrics):
            for user in group.values():
                named = "" if user.name == row.subject else f"{user.name}, "
                for own in user.assumptions():
                    if (own.subject, own.key) == (row.subject, row.key):
                        found += [
                            (value, effect, text and named + text)
                            for value, effect, text in effects.get((user.name, own.path), [])
                        ]
        shown = row.as_dict() | {"choices": " or ".join(map(str, row.choices))}
        rows.append(shown | _effect_columns(row, found))
    write_csv(path, ASSUMPTION_COLUMNS, rows)


def _largest(dataset, variant, name, step=None):
    values = dataset[name].sel(variant=variant)
    return float(
        values.isel(step=int(dataset["strain"].values.argmax())) if step is None else values[step]
    )


def yarn_corrections(yarn, name):
    """Rows of the corrections that show on a yarn (its result dataset)."""
    path = yarn["fibre_path"].values[:, :, -1, :2]
    turned = np.unwrap(np.arctan2(path[..., 1], path[..., 0]), axis=1)
    turns = (turned[0, -1] - turned[0, 0]) / (2 * np.pi)
    rows = [(
        "eq (1)", "a reflection (determinant -1): twist does not accumulate",
        "a rotation by 2 pi twist spacing",
        f"turns of a fibre over {yarn.sizes['section'] - 1} sections; printed: 0",
        turns, "turns", name,
    )]  # fmt: skip
    if {"corrected", "printed"} <= set(yarn.get("variant", xr.DataArray([])).values):
        top = int(yarn["strain"].sel(variant="corrected").values.argmax())
        tension = yarn["yarn_tension"].isel(step=top)
        ratio = float(tension.sel(variant="printed") / tension.sel(variant="corrected"))
        rows.append((
            "k1, k2", "tension and bending spring (section 2)",
            "elastic and post-yield stiffness of a filament (section 3)",
            "tension at the largest strain, printed over corrected", ratio, "1", name,
        ))  # fmt: skip
    return rows


def loop_corrections(loop, name):
    """Rows of the corrections that show on a loop (its result dataset)."""
    rows = []
    for order in loop["order"].values:
        for variable, what in (
            ("section_angle_error", "median angle between section and yarn axis"),
            ("section_angle_error_of_diagonal", "the same for the direction (1, 1, 1)"),
        ):
            value = float(np.degrees(loop[variable].sel(order=order)))
            rows.append((
                "eqs (2), (3)", "two successive turns by arctangents of ratios",
                "rotation-minimising frame on the tangent, twist on top",
                f"{what}, {str(order).replace('_', ' ')}", value, "deg", name,
            ))  # fmt: skip
    rows.append((
        "eqs (2), (3)", "arctangent of a ratio", "tangent",
        "part of the curve that runs backwards, where sections flip",
        100 * float(loop["backward_share"]), "%", name,
    ))  # fmt: skip
    scale = 1 - float(loop["course_spacing"] / loop["loop_height"])
    rows.append((
        "section 2.3, limit", "half of the loop height, i.e. one course spacing",
        "wale scale 0.5; the other reading selectable",
        "wale scale at the limit by the other reading", scale, "1", name,
    ))  # fmt: skip
    return rows


def tension_corrections(tension, name, direction):
    """Rows of the corrections that show in a kinematic tensile test (its result dataset)."""
    variants = [str(v) for v in tension["variant"].values]
    reference, where = variants[0], "eq (4)" if direction == "course" else "eq (5)"
    spacing = tension["wale_spacing" if direction == "course" else "course_spacing"].values
    rows = []
    at = f"{name}, {direction}"
    if "printed" in variants:
        edge = spacing[variants.index(reference)].max() - spacing[variants.index("printed")].max()
        rows.append((
            where, "B' = B OB/OC leaves the edge where it is", "z' = zO + r (z - zO)",
            "elongation of one loop at the largest strain that is lost", 1e3 * edge, "mm", at,
        ))  # fmt: skip
    force = _largest(tension, reference, "force_per_loop")
    if force:
        rows.append((
            "force of the fabric", "the tension of the yarn",
            "the derivative of the energy by the spacing pulled",
            "yarn tension over force at the largest strain",
            _largest(tension, reference, "yarn_tension") / force, "1", at,
        ))  # fmt: skip
    if "fabric_strain" in variants:
        ratio = _largest(tension, "fabric_strain", "yarn_tension") / _largest(
            tension, reference, "yarn_tension"
        )
        rows.append((
            "strain in sigma = k3 strain", "not said whether of yarn or fabric", "of the yarn",
            "yarn tension with the fabric's strain over that with the yarn's", ratio, "1", at,
        ))  # fmt: skip
    if "linear" in variants:
        jam = tension["strain"].values[tension["yarn_tension"].sel(variant=reference).values > 0]
        rows.append((
            "lateral contraction", "only its limit is given", "isometric until the limit, or linear",
            "strain where the yarn takes up load, isometric; linear: from 0",
            jam.min() if jam.size else np.nan, "1", at,
        ))  # fmt: skip
    if "viscous" in variants:
        extra = tension["friction_force"].sel(variant="viscous").max()
        rows.append((
            "F = c v", "vanishes as the velocity does", "kept as an option; Coulomb friction beside it",
            "c v at the assumed c and v", float(extra), "N", at,
        ))  # fmt: skip
    return rows


def law_corrections(yarn, name):
    """Rows of the corrections of the tension law: the jump of k3 as printed."""
    strain, tension = (yarn[v].sel(form="printed").values for v in ("law_strain", "law_tension"))
    jumps = np.flatnonzero(np.diff(strain) == 0)
    return [
        (
            "k3", f"jumps at strain {strain[k]:g}", "the two lines meet where they cross",
            "jump of the tension", tension[k + 1] - tension[k], "N", name,
        )
        for k in jumps
    ]  # fmt: skip


def bending_corrections(bending, name, direction):
    """Rows of the corrections that show in a kinematic bending test (its result dataset)."""
    if not {"corrected", "printed"} <= set(bending["variant"].values):
        return []
    along = "course" if direction == "course" else "wale"
    line = bending["centreline"].isel(loop=0).sel(axis=along)
    curvature = bending["curvature"].values
    smallest = int(np.argmin(np.where(curvature > 0, curvature, np.inf)))
    printed, right = (
        line.sel(variant=form).isel(step=smallest).values for form in ("printed", "corrected")
    )
    at = f"{name}, {direction}"
    lost = np.ptp(bending["centreline"].sel(axis="thickness", variant="corrected")
                  .isel(step=int(np.flatnonzero(curvature == 0)[0])).values)  # fmt: skip
    return [
        (
            "eqs (6)-(9)", "drop the thickness coordinate; 0/0 at zero curvature",
            "with x0 and the series at zero", "thickness of the loop that is lost", 1e3 * lost, "mm",
            at,
        ),
        (
            "eqs (10), (11)", "the angle K' = K l/L used as a curvature",
            "multiplied by l: K' is the angle at l",
            f"largest misplacement along the fabric at {curvature[smallest] / 100:.3g} per cm",
            1e3 * np.nanmax(np.abs(printed - right)), "mm", at,
        ),
    ]  # fmt: skip


# Corrections that no scene shows by a number.
FIXED_CORRECTIONS = (
    (
        "spring energies", "1/2 k (l - l0)^2 with k in N",
        "1/2 (EA/l0)(l - l0)^2 and 1/2 (EI/h)(phi - phi0)^2", "a length is missing", "", "", "",
    ),
    (
        "discussion", "missing contact friction makes the tension too high",
        "friction raises the loading tension; affine kinematics and a yarn curve applied to loop"
        " strain make it too high", "", "", "", "",
    ),
    ("names", "Pierce", "Peirce", "", "", "", ""),
)  # fmt: skip


def _corrections_of(dataset):
    """Rows of the corrections that one result shows; only the paper's own model shows any."""
    kind, model, direction = (dataset.attrs[name] for name in ("kind", "model", "direction"))
    if kind == "yarn":
        yarn = dataset.attrs["yarn"]
        return yarn_corrections(dataset, yarn) + law_corrections(dataset, yarn)
    if model != "kinematic":
        return []
    fabric = dataset.attrs["fabric"]
    if kind == "loop":
        return loop_corrections(dataset, fabric)
    of_test = {"tensile": tension_corrections, "bending": bending_corrections}[kind]
    return of_test(dataset, fabric, direction)


def correction_table(files, path):
    """Write what is wrong in the paper as printed, with the size of each error in this study."""
    rows = [row for dataset in opened(files) for row in _corrections_of(dataset)]
    rows = [
        (*row[:4], f"{row[4]:.6g}" if isinstance(row[4], float) else row[4], *row[5:])
        for row in [*rows, *FIXED_CORRECTIONS]
    ]
    write_csv(path, CORRECTION_COLUMNS, rows)
