"""Write the tables of workflow/report/README.md: python workflow/scripts/readme.py [results]."""

import csv
import re
import sys
from pathlib import Path

from knitsim.store.timing import MEDIAN


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def table(columns, rows):
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def short(text):
    """A number with four digits; other text as it is."""
    try:
        return f"{float(text):.4g}"
    except ValueError:
        return text


def assumptions(path):
    rows = []
    for row in rows_of(path):
        ends = f"{short(row['low'])} to {short(row['high'])}" if row["low"] else ""
        plausible = row["choices"] or ends
        value = short(row["value"]) + (f" {row['unit']}" if row["unit"] != "1" else "")
        key = f"`{row['subject']}` {row['key'].replace('_', ' ')}"
        rows.append([key, value, plausible, row["because"], row["largest_effect"]])
    return table(["input", "value", "plausible", "reason", "largest effect over that range"], rows)


def timings(path):
    rows = [
        [row["stage"].replace("_", " "), row["subject"], row["direction"], row["name"],
         f"{1e3 * float(row['value']):.3g} ms",
         f"{float(row['paper_value']) / 60:.0f} min" if row["paper_value"] else ""]
        for row in rows_of(path)
        if row["note"] == MEDIAN
    ]  # fmt: skip
    return table(["stage", "fabric", "direction", "test", "here", "the paper"], rows)


def bought(path):
    """What the default buys, and the time of the cheapest setting for each error asked for."""
    rows, asked = {}, []
    for row in rows_of(path):
        test = f"{row['solver']}: {row['test']}", row["quantity"]
        asked += [row["asked"]] if row["asked"] not in ("default", *asked) else []
        cells = rows.setdefault(test, {})
        if not row["seconds"]:
            cells[row["asked"]] = "not reached"
            continue
        time = f"{1e3 * float(row['seconds']):.3g} ms"
        if row["asked"] == "default":
            time = f"{100.0 * float(row['error']):.2g} % in {time}"
        cells[row["asked"]] = time
    columns = ["default", *asked]
    body = [[*test, *(cells.get(c, "") for c in columns)] for test, cells in rows.items()]
    return table(["test", "error of", *columns], body)


def compared(path):
    """This solver and PyElastica on the scenes that both can do, if the full benchmark was run."""
    if not path.exists():
        return None
    body = []
    for row in rows_of(path):
        if not row["target"]:
            continue
        time = f"{1e3 * float(row['seconds']):.3g} ms" if row["seconds"] else ""
        body.append([row["scene"], row["solver"], row["target"], time or row["settings"],
                     short(row["times_slower"])])  # fmt: skip
    return table(["scene", "solver", "relative error", "CPU time", "times slower"], body)


def campaigns(folder):
    """The summaries of those campaigns that were run."""
    rows = [
        [name, row["quantity"], short(row["value"]), row["limit"]]
        for name, file in (
            ("tension", "campaign_summary.csv"),
            ("bending", "bending_campaign_summary.csv"),
            ("shear", "shear_campaign_summary.csv"),
            ("friction", "friction_campaign_summary.csv"),
            ("patterns", "pattern_campaign_summary.csv"),
            ("stress", "stress_summary.csv"),
        )
        if (folder / file).exists()
        for row in rows_of(folder / file)
        if row.get("family", "all") == "all"
    ]
    return table(["campaign", "quantity", "value", "limit"], rows) if rows else None


results = Path(sys.argv[1] if len(sys.argv) > 1 else "results") / "tables"
readme = Path("workflow/report/README.md")
text = readme.read_text(encoding="utf-8")
for name, content in (
    ("assumptions", assumptions(results / "assumptions.csv")),
    ("timings", timings(results / "timing.csv")),
    ("benchmark", bought(results.parent / "benchmark/error_bought.csv")),
    ("campaigns", campaigns(results)),
    ("comparison", compared(results.parent / "benchmark/full/comparison.csv")),
):
    if content is None:  # keep what an earlier run has left
        continue
    text = re.sub(
        rf"(<!-- {name}: begin[^\n]*-->\n).*?(<!-- {name}: end -->)",
        lambda found, content=content: f"{found[1]}\n{content}\n\n{found[2]}",
        text,
        flags=re.DOTALL,
    )
readme.write_text(text, encoding="utf-8")
