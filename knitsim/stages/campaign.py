"""Random fabrics through the equilibrium model, each result judged by code of its own.

Outcomes: "reached", the asked strain was reached and the judge found nothing; "stopped", the curve
ended before with its reason; "refused", InputError or ComputationError with its reason; "wrong", the
judge found something in what was computed, or the solver failed in another way.  Stopped states are
judged too, and the judge takes the force to be as exact as the solver's own error estimate says.
"""

import dataclasses
import math
import time
from functools import partial

import numpy as np

from knitsim.equilibrium.fabric import BarrierContact, Fabric, Resolution
from knitsim.equilibrium.relax import relax
from knitsim.equilibrium.tension import tensile
from knitsim.errors import ComputationError, InputError
from knitsim.evaluation.campaign import POINTS, SEED, Case, draw, impossible
from knitsim.evaluation.judge import States, judge
from knitsim.evaluation.judge_energy import Given
from knitsim.yarn.law import TensionLaw

# Strains of stored states: close together where friction sets in, then this far apart at most.
FIRST, STORED = (0.0025, 0.005), 0.01
REACHED, STOPPED, REFUSED, WRONG = "reached", "stopped", "refused", "wrong"
LEAST_REACHED = 0.97  # of the possible cases
EXACT = 0.05  # estimated error of the force up to which a test counts as exact in the summary

_INPUTS = [f.name for f in dataclasses.fields(Case)]
_RESULTS = ("outcome", "reached_strain", "yarn_strain", "min_distance", "numerical_error", "reason")
COLUMNS = [
    *_INPUTS, "possible", "impossible_because", "outcome", "rest_outcome", "rest_reason",
    *(f"{direction}_{name}" for direction in ("course", "wale") for name in _RESULTS),
]  # fmt: skip
TIMES = ("number", "relaxing", "course", "wale", "errors", "judging")
SUMMARY = ("quantity", "value", "limit")


def run(numbers, seed=SEED):
    """Rows of results (mappings by COLUMNS) and of CPU times (by TIMES, s) of the cases ``numbers``."""
    rows, times = [], []
    for number in numbers:
        case = draw(number, seed)
        clock = _Clock()
        rows.append(_row(case, clock))
        times.append({"number": number, **{k: f"{clock.spent[k]:.4g}" for k in TIMES[1:]}})
    return rows, times


class _Clock:
    """CPU time by what it was spent on."""

    def __init__(self):
        self.spent = dict.fromkeys(TIMES[1:], 0.0)

    def time(self, name, call, *args):
        start = time.process_time()
        try:
            return call(*args)
        finally:
            self.spent[name] += time.process_time() - start


def _row(case, clock):
    reasons = impossible(case)
    row = dict.fromkeys(COLUMNS, "")
    for name in _INPUTS:
        value = getattr(case, name)
        row[name] = " ".join(f"{v:.9g}" for v in value) if isinstance(value, tuple) else value
    row |= {"possible": "no" if reasons else "yes", "impossible_because": "; ".join(reasons)}
    relaxed, row["rest_outcome"], row["rest_reason"] = _guarded(
        lambda: clock.time("relaxing", _relaxed, case)
    )
    if relaxed is None:
        row["outcome"] = row["rest_outcome"]
        return row
    given = _given(case, relaxed)
    rest = _rest(relaxed)
    row["rest_outcome"], row["rest_reason"] = _verdict(
        REACHED, "", clock.time("judging", judge, given, rest)
    )
    outcomes = [row["rest_outcome"]]
    for direction in ("course", "wale"):
        found = _test(case, given, relaxed, rest, direction, clock)
        row |= {f"{direction}_{name}": value for name, value in found.items()}
        outcomes.append(found["outcome"])
    row["outcome"] = max(outcomes, key=(REACHED, STOPPED, REFUSED, WRONG).index)
    return row


def _relaxed(case):
    law = TensionLaw(case.law_strain, case.law_tension, case.breaking_strain)
    fabric = Fabric(
        case.wale_spacing, case.course_spacing, case.loop_length, case.diameter,
        case.bending_rigidity, law, BarrierContact(case.contact_stiffness), case.friction,
    )  # fmt: skip
    return relax(fabric, Resolution(POINTS))


def _guarded(call):
    """(result or None, outcome, reason) of a call to the solver."""
    try:
        return call(), REACHED, ""
    except (InputError, ComputationError) as error:
        return None, REFUSED, f"{type(error).__name__}: {error}"
    except Exception as error:  # whatever else happens is the solver's fault, and counts so
        return None, WRONG, f"{type(error).__name__}: {error}"


def _verdict(outcome, reason, findings):
    return (WRONG, "; ".join(map(str, findings))) if findings else (outcome, reason)


def _given(case, relaxed):
    model = relaxed.model
    return Given(
        case.loop_length, case.diameter, case.bending_rigidity, case.law_strain, case.law_tension,
        case.contact_stiffness, case.friction, model.cell.points, model.cell.contacts,
    )  # fmt: skip


def _rest(relaxed):
    zero = np.zeros(1)
    return States(
        relaxed.centreline[None], np.array([relaxed.wale_spacing]),
        np.array([relaxed.course_spacing]), zero, zero, relaxed.energy[None], zero, zero,
        np.array([relaxed.min_distance]), np.full(1, np.nan),
    )  # fmt: skip


def _states(rest, curve, error):
    """The states of a curve after the rest; error: estimated error of its forces."""
    values = {
        "centreline": curve.centreline, "wale_spacing": curve.wale_spacing,
        "course_spacing": curve.course_spacing, "strain": curve.strain,
        "force": curve.force_per_loop, "energy": curve.energy, "work": curve.work,
        "dissipated": curve.dissipated, "min_distance": curve.min_distance,
        "numerical_error": error,
    }  # fmt: skip
    return States(**{name: np.concatenate([getattr(rest, name), v]) for name, v in values.items()})


def _test(case, given, relaxed, rest, direction, clock):
    """Results (by _RESULTS) of one test of a relaxed fabric."""
    asked = case.asked(direction)
    steps = math.ceil(asked / STORED)
    strains = np.concatenate([FIRST, asked * np.arange(1, steps + 1) / steps])
    found = dict.fromkeys(_RESULTS, "")
    curve, found["outcome"], found["reason"] = _guarded(
        lambda: clock.time(direction, tensile, relaxed, direction, strains)
    )
    if curve is None:
        return found
    known, _, _ = _guarded(
        lambda: clock.time(
            "errors", partial(tensile, relaxed, direction, strains, estimate_error=True)
        )
    )
    error = np.full(curve.steps, np.nan) if known is None else known.numerical_error
    outcome, reason = (STOPPED, curve.stop_reason) if curve.stop_reason else (REACHED, "")
    states = _states(rest, curve, error)
    found["outcome"], found["reason"] = _verdict(
        outcome, reason,
        clock.time(
            "judging", judge, given, states, direction, asked if outcome == REACHED else None
        ),
    )  # fmt: skip
    found["reached_strain"] = float(curve.strain[-1])
    found["yarn_strain"] = float(curve.yarn_strain[-1])
    found["min_distance"] = float(curve.min_distance[-1])
    found["numerical_error"] = float(error[-1])
    return found


def summary(rows):
    """Rows (by SUMMARY) of what the campaign came to; rows: mappings by COLUMNS."""
    possible = [row for row in rows if row["possible"] == "yes"]

    def count(which, *outcomes):
        return sum(row["outcome"] in outcomes for row in which)

    reached = count(possible, REACHED)
    table = [
        ("cases", len(rows), ""),
        ("possible cases", len(possible), ""),
        (
            "possible cases that reached both asked strains, per cent",
            f"{100.0 * reached / max(len(possible), 1):.4g}", f"{100.0 * LEAST_REACHED:g} or more",
        ),
        ("possible cases that stopped before with a reason", count(possible, STOPPED), ""),
        ("possible cases that were refused with a reason", count(possible, REFUSED), ""),
        ("wrong results in all cases", count(rows, WRONG), "0"),
        (
            "cases called impossible that reached both asked strains",
            count(rows, REACHED) - reached, "",
        ),
    ]  # fmt: skip
    for direction in ("course", "wale"):
        done = [row for row in possible if row[f"{direction}_outcome"] == REACHED]
        exact = sum(float(row[f"{direction}_numerical_error"]) <= EXACT for row in done)
        table += [
            (f"possible cases that reached the asked {direction} strain", len(done), ""),
            (
                f"of these, with an estimated error of the force of {100 * EXACT:g} % at most",
                exact,
                "",
            ),
        ]
    return table
