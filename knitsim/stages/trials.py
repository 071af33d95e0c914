"""Campaigns of random fabrics through the equilibrium model: their parts, all their rows, the summary."""

import csv
from collections import Counter

from knitsim.verification.trials.law import PEIRCE
from knitsim.verification.trials.rule import AT_REST, LEAST_BULK, NARROW, THICK, TIGHTEST
from knitsim.verification.trials.run import COLUMNS as COLUMNS
from knitsim.verification.trials.run import OUTCOMES, REFUSED, STOPPED, VERIFIED, WRONG, run
from knitsim.verification.trials.run import TIMES as TIMES
from knitsim.verification.trials.table import CAMPAIGNS as CAMPAIGNS
from knitsim.verification.trials.worst import FAMILIES

SUMMARY = ("quantity", "family", "value", "limit")
EXACT = 0.05  # estimated error of the load up to which a test counts as exact in a summary
# Of the rule for possible cases, for the map: B/(K d^3), room for the loop in diameters, l/d, curvature
# times diameter; and the families of cases.
LIMITS = {
    "narrow": NARROW, "room": PEIRCE * AT_REST, "bulk": LEAST_BULK, "curvature": TIGHTEST / THICK,
    "families": tuple(FAMILIES),
}  # fmt: skip


def part_of(name, part, parts, seed=None, cases=None):
    """Rows of results (by COLUMNS) and of CPU times (by TIMES) of one of the parts of a campaign.

    seed, cases: other ones than those of the campaign's row.
    """
    campaign = CAMPAIGNS[name]
    return run(campaign, range(cases or campaign.cases)[part::parts], seed)


def gathered(paths):
    """Rows (mappings, values as text) of the CSV files of all parts, by the number of the case."""
    rows = []
    for path in paths:
        with open(path, newline="", encoding="utf-8") as file:
            rows += csv.DictReader(file)
    return sorted(rows, key=lambda row: int(row["number"]))


def summary(name, rows):
    """Rows (by SUMMARY) of what a campaign came to: all cases, and each family and kind of them.

    rows: mappings by COLUMNS.  A case has the worst outcome of its tests.
    """
    cases = {}
    for row in rows:
        cases.setdefault(row["number"], []).append(row)
    kinds = dict.fromkeys(kind for row in rows for kind in row["kinds"].split("; "))
    seeds = "; ".join(sorted({str(row["seed"]) for row in rows}))
    table = [("seed", "all", seeds, "")]
    for kind in ("all", *sorted(kinds)):
        own = [c for c in cases.values() if kind == "all" or kind in c[0]["kinds"].split("; ")]
        possible = [case for case in own if case[0]["possible"] == "yes"]
        of_all, of_possible = (Counter(map(_outcome, some)) for some in (own, possible))
        solved = f"{100.0 * of_possible[VERIFIED] / max(len(possible), 1):.4g}"
        tests = [row for case in possible for row in case if row["outcome"] == VERIFIED]
        errors = [float(row["estimated_error"]) for row in tests if row["estimated_error"] != ""]
        limits = {VERIFIED: f"{100.0 * CAMPAIGNS[name].solved:g} or more", WRONG: "0"}
        limits = limits if kind == "all" else dict.fromkeys(limits, "")
        table += [
            ("cases", kind, len(own), ""),
            ("possible cases", kind, len(possible), ""),
            ("possible cases solved and verified, per cent", kind, solved, limits[VERIFIED]),
            ("possible cases that stopped before with a reason", kind, of_possible[STOPPED], ""),
            ("possible cases that were refused with a reason", kind, of_possible[REFUSED], ""),
            ("wrong results in all cases", kind, of_all[WRONG], limits[WRONG]),
            (
                "cases called impossible that were solved and verified", kind,
                of_all[VERIFIED] - of_possible[VERIFIED], "",
            ),
            ("tests of possible cases verified that estimate the error of the load", kind, len(errors), ""),
            (
                f"of these, with an error of {100 * EXACT:g} % at most", kind,
                sum(error <= EXACT for error in errors), "",
            ),
            (
                "of the tests verified, fabrics that snap from one shape to another", kind,
                sum(row["snaps"] == "yes" for row in tests), "",
            ),
        ]  # fmt: skip
    return table


def _outcome(case):
    return max((row["outcome"] for row in case), key=OUTCOMES.index)
