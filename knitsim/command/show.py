"""``knitsim show RESULTS``: what a run has found, one fabric a row."""

import csv
import shutil
from pathlib import Path
from textwrap import wrap

from knitsim.errors import InputError
from knitsim.store.results import DIRECTIONS

TABLE = "tables/summary.csv"
# Heading, its unit, and the columns of the table that stand in it, set apart by a slash.
SHOWN = (
    ("w x c stated", "mm", ("stated_wale_spacing_mm", "stated_course_spacing_mm")),
    ("at rest", "mm", ("rest_wale_spacing_mm", "rest_course_spacing_mm")),
    ("mass", "g/m2", ("rest_mass_per_area_g_per_m2",)),
    ("strain at 50", "gf/cm, %", "strain_at_50_gf_per_cm_percent"),
    ("residual", "%", "residual_strain_percent"),
    ("B", "gf cm2/cm", "B_gf_cm2_per_cm"),
    ("2HB", "gf cm/cm", "2HB_gf_cm_per_cm"),
    ("curl", "gf cm/cm", "curl_moment_gf_cm_per_cm"),
    ("error", "%", ("largest_numerical_error_percent",)),
)
NONE = "-"


def show_options(parser):
    """Options of ``knitsim show``."""
    parser.add_argument("results", metavar="RESULTS", nargs="?", default="results")


def show(given):
    """Print the table of the results in a directory, or of the study in it."""
    results = Path(given.results)
    if not (results / TABLE).exists() and (results / "results" / TABLE).exists():
        results = results / "results"
    show_results(results)
    return 0


def show_results(results):
    """Print what ``results`` hold; raises InputError if no run has ended there."""
    try:
        with (results / TABLE).open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except OSError:
        raise InputError(
            results / TABLE, None, "is not there: knitsim run DIR makes results in DIR/results"
        ) from None
    print("\n".join(lines_of(rows, results, shutil.get_terminal_size((110, 24)).columns)))


def lines_of(rows, results, width=110):
    """The lines of the table of ``rows`` (dicts of tables/summary.csv), notes and files below."""
    cells = [["fabric", *(heading for heading, _, _ in SHOWN)]]
    cells.append(["", *(unit for _, unit, _ in SHOWN)])
    cells += [[row["fabric"], *(_cell(row, columns) for _, _, columns in SHOWN)] for row in rows]
    # A column in which nothing is known is not shown.
    kept = [
        k for k in range(len(cells[0]))
        if k == 0 or not rows or any(line[k].strip("- /") for line in cells[2:])
    ]  # fmt: skip
    wide = [max(len(line[k]) for line in cells) for k in kept]
    lines = [
        "  ".join(line[k].ljust(w) for k, w in zip(kept, wide, strict=True)).rstrip()
        for line in cells
    ]
    lines.insert(2, "  ".join("-" * w for w in wide))
    lines.append("pairs: along the course / along the wale (w x c: wale spacing / course spacing)")
    for row in rows:
        for direction in DIRECTIONS:
            force = row[f"force_at_largest_strain_gf_per_cm_{direction}"]
            if force and not row[f"strain_at_50_gf_per_cm_percent_{direction}"]:
                at = row[f"force_at_percent_{direction}"]
                lines.append(f"{row['fabric']}, {direction}: {force} gf/cm at {at} %")
        for name, why in (
            ("note", row.get("note", "")), ("stopped", row["stopped"]), ("not read", row["left_out"]),
            ("measured", row.get("measured", "")),
        ):  # fmt: skip
            for one in filter(None, why.split("; ")):
                lines += wrap(f"{row['fabric']}: {name}: {one}", width, subsequent_indent="    ")
    files = {"page": "index.html", "tables": "tables/", "figures": "figures/"}
    lines += [
        f"{name}: {results / file}" for name, file in files.items() if (results / file).exists()
    ]
    return lines


def _cell(row, columns):
    if isinstance(columns, str):
        columns = [f"{columns}_{direction}" for direction in DIRECTIONS]
    values = [row.get(column, "") for column in columns]  # of an older table, too
    return " / ".join(value or NONE for value in values) if any(values) else NONE
