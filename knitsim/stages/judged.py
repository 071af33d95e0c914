"""What the campaigns of random fabrics share: cases under guard and timed, told to the judge, in rows.

Outcomes of a case: "verified", all that was asked was reached and the judge found nothing; "stopped",
the test ended before with its reason; "refused", InputError or ComputationError with its reason;
"wrong", the judge found something, or the solver failed in another way.  Stopped tests are judged too.
"""

import csv
import time

import numpy as np

from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.fabric import Fabric
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError, InputError
from knitsim.verification.bending_judge import TestStates
from knitsim.verification.judge_energy import Given
from knitsim.yarn.law import TensionLaw

VERIFIED, STOPPED, REFUSED, WRONG = OUTCOMES = ("verified", "stopped", "refused", "wrong")
EXACT = 0.05  # estimated error of the load up to which a test counts as exact in a summary


def rows_of(numbers, draw, row_of, columns):
    """Rows of results and of CPU times (by ``columns``, s) of the cases ``numbers``.

    draw: gives the case of a number; row_of: the row of a case, solved with a :class:`Clock`.
    """
    rows, times = [], []
    for number in numbers:
        clock = Clock(columns[1:])
        rows.append(row_of(draw(number), clock))
        times.append({"number": number, **clock.row()})
    return rows, times


class Clock:
    """CPU time by what it was spent on."""

    def __init__(self, names):
        self.spent = dict.fromkeys(names, 0.0)

    def time(self, name, call, *args, **more):
        """What the call gives; its time is added under the name."""
        start = time.process_time()
        try:
            return call(*args, **more)
        finally:
            self.spent[name] += time.process_time() - start

    def row(self):
        """Times so far, four digits."""
        return {name: f"{spent:.4g}" for name, spent in self.spent.items()}


def guarded(call):
    """(result or None, outcome, reason) of a call to the solver."""
    try:
        return call(), VERIFIED, ""
    except (InputError, ComputationError) as error:
        return None, REFUSED, f"{type(error).__name__}: {error}"
    except Exception as error:  # whatever else happens is the solver's fault, and counts so
        return None, WRONG, f"{type(error).__name__}: {error}"


def relaxed_of(fabric, resolution):
    """The relaxed :class:`campaign.Case` ``fabric``."""
    law = TensionLaw(fabric.law_strain, fabric.law_tension, fabric.law_strain[-1])
    return relax(
        Fabric(
            fabric.wale_spacing, fabric.course_spacing, fabric.loop_length, fabric.diameter,
            fabric.bending_rigidity, law, BarrierContact(fabric.contact_stiffness), fabric.friction,
        ),
        resolution,
    )  # fmt: skip


def given_of(fabric, relaxed):
    """What the judge is told of a :class:`campaign.Case` and of how finely it was solved."""
    cell = relaxed.model.cell
    return Given(
        fabric.loop_length, fabric.diameter, fabric.bending_rigidity, fabric.law_strain,
        fabric.law_tension, fabric.contact_stiffness, fabric.friction, cell.points, cell.contacts,
    )  # fmt: skip


def tension_states(relaxed, curve):
    """TestStates of a tensile Curve, from the relaxed fabric on."""
    values = {
        "centreline": (relaxed.centreline, curve.centreline),
        "wale_spacing": (relaxed.wale_spacing, curve.wale_spacing),
        "course_spacing": (relaxed.course_spacing, curve.course_spacing),
        "coordinate": (0.0, curve.strain),
        "load": (0.0, curve.force_per_loop),
        "energy": (relaxed.energy, curve.energy),
        "work": (0.0, curve.work),
        "dissipated": (0.0, curve.dissipated),
        "min_distance": (relaxed.min_distance, curve.min_distance),
        "numerical_error": (np.nan, curve.numerical_error),
    }
    return TestStates(
        **{name: np.concatenate([np.asarray(a)[None], b]) for name, (a, b) in values.items()}
    )


def bending_states(curve):
    """TestStates of a BendingCurve."""
    return TestStates(
        curve.centreline, curve.wale_spacing, curve.course_spacing, curve.curvature,
        curve.moment_per_width, curve.energy, curve.work, curve.dissipated, curve.min_distance,
        curve.numerical_error,
    )  # fmt: skip


def inputs_of(case, names, columns, reasons):
    """Row of a case: its inputs of these names, and why it is impossible; the other columns empty."""
    row = dict.fromkeys(columns, "")
    for name in names:
        value = getattr(case, name)
        row[name] = " ".join(f"{v:.9g}" for v in value) if isinstance(value, tuple) else value
    return row | {"possible": "no" if reasons else "yes", "impossible_because": "; ".join(reasons)}


def gathered(paths):
    """Rows (mappings, values as text) of the CSV files of all parts, by the number of the case."""
    rows = []
    for path in paths:
        with open(path, newline="", encoding="utf-8") as file:
            rows += csv.DictReader(file)
    return sorted(rows, key=lambda row: int(row["number"]))


def exactness(possible, direction, outcome, title, load):
    """Rows (by SUMMARY): how many tests in this direction had the outcome, and how many to EXACT."""
    done = [row for row in possible if row[f"{direction}_outcome"] == outcome]
    exact = sum(float(row[f"{direction}_numerical_error"]) <= EXACT for row in done)
    said = f"of these, with an estimated error of the {load} of {100 * EXACT:g} % at most"
    return [(title, len(done), ""), (said, exact, "")]
