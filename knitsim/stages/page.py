"""The page of a study: ``index.html``, one file to look at and to send, with links to what is behind it."""

import base64
import csv
import hashlib
import io
import sys
from pathlib import Path

import jinja2
from PIL import Image

import knitsim
from knitsim import units
from knitsim.figures import catalogue
from knitsim.files import replacing
from knitsim.store.reader import attributes
from knitsim.store.results import DIRECTIONS
from knitsim.study.measured_checks import names_of

# Figures that stand in the page itself; beyond, in a sweep, there are links, and the first of each fabric.
MOST_EMBEDDED = 60
FIRST = "fig00_load_extension"
# Conditions of the tests that stand in a data sheet, the first that is there.
SHOWN_CONDITIONS = ("kes", "friction", "")
KES = {
    "tensile": ("EMT 50 gf/cm", "LT 50 gf/cm", "WT 50 gf/cm", "RT 50 gf/cm", "residual_strain 50 gf/cm"),
    "bending": ("B", "2HB"),
    "shear": ("G", "2HG", "2HG5"),
}  # fmt: skip


def write_page(study, path):
    """Write the page of a Study whose results lie in the directory of ``path``."""
    content, left = page_of(study, Path(path).parent)
    if left:
        print(
            f"knitsim: {len(left)} result files are of yarns or fabrics that the study no longer has, "
            f"such as {left[0]}; the page lists them",
            file=sys.stderr, flush=True,
        )  # fmt: skip
    with replacing(path) as partial:
        partial.write_text(content, encoding="utf-8")


def page_of(study, root):
    """(HTML of the page, files of what the study no longer has); same results, same bytes."""
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    environment = jinja2.Environment(
        loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["short"] = _short
    rows = {
        name: _rows(root / f"tables/{name}.csv")
        for name in ("summary", "kes", "curl", "calibration")
    }
    pictures = _pictures(study, root)
    # A stable sort: the first figure of each fabric, then the others in their order.
    embedded = set(sorted(pictures, key=lambda png: FIRST not in png)[:MOST_EMBEDDED])
    files, left = _provenance(study, root)
    html = environment.get_template("page.html").render(
        version=knitsim.__version__,
        summary=rows["summary"],
        fabrics=[
            {
                "name": name,
                "inputs": [*_inputs(fabric), *_derived(fabric)],
                "yarn": fabric.yarn.name,
                "yarn_inputs": _inputs(fabric.yarn),
                "kes": _kes(rows["kes"], name),
                "curl": [
                    r for r in rows["curl"] if r["fabric"] == name and r["model"] == "equilibrium"
                ],
                "calibrated": [_calibrated(r) for r in rows["calibration"] if r["fabric"] == name],
                "notes": _notes(rows["summary"], name),
            }
            for name, fabric in study.fabrics.items()
        ],
        pictures=[
            one | {"data": _data(root / one["png"]) if png in embedded else ""}
            for png, one in pictures.items()
        ],
        corrections=_rows(root / "tables/corrections.csv"),
        assumptions=_rows(root / "tables/assumptions.csv"),
        tables=_files(root, "tables/*.csv"),
        files=files,
        left=left,
    )
    return html, left


def _rows(path):
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _inputs(resolved):
    """[(key, value with its unit, reason of an assumption or "", stated or default)] of one entry."""
    reasons = {row.path: row for row in resolved.assumptions()}
    found = []
    for quantity, keys in resolved.section.quantities().items():
        value = resolved.values.get(quantity)
        if value is None or quantity in ("scene", "yarn", "source"):
            continue
        row = next((reasons[key.name] for key in keys if key.name in reasons), None)
        key = next((key for key in keys if resolved.states(key.name)), keys[0])
        found.append(_input(key, value, row))
    for section in resolved.section.sections:
        inner = resolved.values.get(section.name)
        if not inner or section.named:
            continue
        for quantity, keys in section.quantities().items():
            if inner.get(quantity) is not None:
                name = f"{section.name}.{keys[0].name}"
                found.append(_input(keys[0], inner[quantity], reasons.get(name), section.name))
    return found


def _derived(fabric):
    """What follows from the inputs and textile people go by, as :func:`_inputs` gives it."""
    if fabric.values.get("tightness_factor") is not None:
        return []
    return [{"name": "tightness factor", "value": f"{fabric.tightness_factor:.3g} tex^0.5/cm, from count and "
             "loop length", "because": "", "range": ""}]  # fmt: skip


def _input(key, value, row, section=""):
    name = key.name.removesuffix(f"_{key.unit}") if key.unit else key.name
    unit = units.label(key.unit) if key.unit else ""
    return {
        "name": f"{section} {name}".strip().replace("_", " "),
        "value": value if key.name == "file" else f"{_shown(value, key.unit)} {unit}".strip(),
        "because": row.because if row else "",
        "range": f"{row.low:g} to {row.high:g}" if row and row.low is not None else "",
    }


def _shown(value, unit):
    if isinstance(value, (list, tuple)):
        return ", ".join(_shown(one, unit) for one in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value.replace("_", " ")
    return f"{units.from_si(value, unit) if unit else value:.5g}"


def _kes(rows, fabric):
    """[{parameter, definition, units, course, wale, condition}] of one fabric, equilibrium model."""
    found = []
    for test, parameters in KES.items():
        own = [
            r for r in rows if (r["fabric"], r["test"], r["model"]) == (fabric, test, "equilibrium")
        ]
        conditions = list(dict.fromkeys(r["variant"] for r in own))
        condition = next((c for c in SHOWN_CONDITIONS if c in conditions), *conditions[:1] or [""])
        for parameter in parameters:
            cells = {
                r["direction"]: r for r in own
                if (r["variant"], r["name"]) == (condition, parameter)
            }  # fmt: skip
            if not cells:
                continue
            # Shear has no direction.
            given = (
                {d: cells.get(d) for d in DIRECTIONS} if "" not in cells else {"both": cells[""]}
            )
            found.append(
                {
                    "name": parameter.replace("_", " "),
                    "units": next((r["kes_units"] for r in cells.values() if r["kes_units"]), ""),
                    "definition": next(
                        (r["definition"] for r in cells.values() if r["definition"]), ""
                    ),
                    "condition": f"{test}, {condition}".rstrip(", "),
                    "left_out": "; ".join(
                        f"{d}: {r['left_out']}".removeprefix(": ")
                        for d, r in cells.items()
                        if r["left_out"]
                    ),
                    **{d: _with_error(r) if r else "" for d, r in given.items()},
                }
            )
    return found


def _calibrated(row):
    """A row of a calibration as the page shows it: a parameter in the unit of its key, or the fit."""
    told = {
        key: units.value_text(float(row[key]), row["units"]) if row[key] else ("", "")
        for key in ("value", "low", "high")
    }
    whole = row["name"] == "all"
    return {key: number for key, (number, _) in told.items()} | {
        "calibration": row["calibration"], "says": row["says"],
        "name": "the fit" if whole else row["name"].replace("_", " "),
        "unit": told["value"][1],
        "loud": any(word in row["says"] for word in ("not at all", "not determined", "value allowed")),
    }  # fmt: skip


def _short(text):
    """A number of a table to five digits; words as they are."""
    try:
        return f"{float(text):.5g}"
    except ValueError:
        return text


def _number(text):
    return f"{float(text):.4g}" if text else ""


def _with_error(row):
    """A KES parameter and, where it is more than a thousandth, the error of its reading between states."""
    value, error = (float(row[name] or "nan") for name in ("value", "error"))
    share = abs(error / value) if value else 0.0
    text = _number(row["kes_value"])
    return f"{text} ± {share * abs(float(row['kes_value'])):.1g}" if share > 1e-3 else text


def _notes(rows, fabric):
    row = next((r for r in rows if r["fabric"] == fabric), None)
    if row is None:
        return []
    kinds = (
        ("note", "Note"),
        ("stopped", "Stopped"),
        ("left_out", "Not read"),
        ("measured", "Beside what was measured"),
    )
    return [f"{name}: {row[key]}" for key, name in kinds if row[key]]


def _pictures(study, root):
    """{path of the PNG: what it is} of every figure that is there, in the order of the catalogue."""
    found = {}
    subjects = {"yarn": list(study.yarns), "fabric": list(study.fabrics), "study": [""]}
    measured = [name for name, fabric in study.fabrics.items() if names_of(fabric)]
    for figure in catalogue.FIGURES:
        names = measured if figure.group == "measured" else subjects[figure.of]
        for number, subject in enumerate(names):
            stem = f"figures/{figure.name}" + (f"_{subject}" if number else "")
            if (root / f"{stem}.png").exists():
                found[f"{stem}.png"] = {
                    "id": Path(stem).name, "subject": subject, "caption": figure.caption,
                    "number": figure.name[3:5], "png": f"{stem}.png", "svg": f"{stem}.svg",
                    "first": figure.name == FIRST,
                    "behind": _behind(figure, subject, root),
                }  # fmt: skip
    return found


def _behind(figure, subject, root):
    """The result files that a figure is drawn from."""
    files = catalogue.files_of(figure.of, subject)
    found = []
    for name in (*figure.needs, *figure.takes):
        found += _files(root, files[name].replace("{calibration}", "*"))
    return list(dict.fromkeys(found))


def _data(path):
    """A picture as the page holds it: a quarter of the PNG in size, which is one click away."""
    content = io.BytesIO()
    Image.open(path).convert("RGB").save(content, "WEBP", quality=80, method=2)
    return "data:image/webp;base64," + base64.b64encode(content.getvalue()).decode("ascii")


def _files(root, pattern):
    return [file.relative_to(root).as_posix() for file in sorted(root.glob(pattern))]


def _provenance(study, root):
    """([{file, size, hash, source}] of every result file and table of a Study, files that lie there of yarns
    and fabrics which it no longer has)."""
    found, left = [], []
    fabrics, yarns = {None, "", *study.fabrics}, {None, "", *study.yarns}
    for file in [*_files(root, "*/**/*.nc"), *_files(root, "tables/*.csv")]:
        if file == "tables/timing.csv":  # differs from run to run
            continue
        content = (root / file).read_bytes()
        said = attributes(root / file) if file.endswith(".nc") else {}
        # What an earlier study has left.
        if said.get("fabric") not in fabrics or said.get("yarn") not in yarns:
            left.append(file)
            continue
        found.append(
            {
                "file": file, "kilobytes": f"{len(content) / 1024:.0f}",
                "hash": hashlib.sha256(content).hexdigest()[:16], "source": said.get("source_hash", ""),
                "title": said.get("title", ""),
            }
        )  # fmt: skip
    return found, left
