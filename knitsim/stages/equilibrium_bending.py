"""The bending test in the equilibrium model, in every condition that the scene names."""

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.interpolate import CubicSpline

from knitsim.equilibrium import pull as tension
from knitsim.equilibrium.bend import FRICTION_INCREMENT, bend
from knitsim.equilibrium.relax import relax
from knitsim.errors import ComputationError, InputError
from knitsim.kes.rigidity import rigidity_and_curl
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import (
    resolution_of,
    settings_of,
    solver_fabric,
    states_dataset,
    status_of,
    variants_dataset,
)
from knitsim.stages.laws import ledger_laws
from knitsim.stages.ledger import effect_dataset
from knitsim.store.timing import Timings
from knitsim.study.schema import closure
from knitsim.units import from_si

STAGE = "equilibrium_bending"
DIRECTIONS = ("course", "wale")
_GAUSS = np.polynomial.legendre.leggauss(2)


def curvatures_of(choice):
    """Flat, to the largest curvature, through flat to its negative, and back to flat (1/m).

    That for every cycle; the ends are hit exactly.
    """
    up = choice["max_curvature"] * np.arange(1, choice["states"] + 1) / choice["states"]
    back = np.concatenate([up[-2::-1], [0.0]])
    return np.concatenate([[0.0], *[np.concatenate([up, back, -up, -back])] * choice["cycles"]])


def yarn_strain(flat, curvature, axis, loop_length):
    """Strain of the yarn of one loop of a bent fabric, at two places a piece, (2 (points - 1),).

    flat: (points, 3) (m), in the coordinates of the fabric before it is rolled up, at equal lengths
    of the yarn at rest, the last the first of the next loop.  On a cylinder what lies at thickness z
    is longer along the bent direction (axis) by 1 + curvature z.
    """
    at = np.linspace(0.0, 1.0, len(flat))
    step = flat[-1] - flat[0]
    closed = flat - at[:, None] * step
    closed[-1] = closed[0]
    line = CubicSpline(at, closed, bc_type="periodic")
    places = (at[:-1, None] + np.diff(at)[:, None] * 0.5 * (1.0 + _GAUSS[0])).ravel()
    speed = line(places, 1) + step
    speed[:, axis] *= 1.0 + curvature * line(places)[:, 2]
    return np.linalg.norm(speed, axis=1) / loop_length - 1.0


def bending_dataset(curve, direction, law, loop_length, steps=None):
    """Dataset of a knitsim.equilibrium BendingCurve, padded to ``steps`` stored states."""
    n, axis = curve.steps, DIRECTIONS.index(direction)
    strain, tension = np.empty(n), np.empty(n)
    for k, (flat, kappa) in enumerate(zip(curve.centreline, curve.curvature, strict=True)):
        local = yarn_strain(flat, kappa, axis, loop_length)
        strain[k], tension[k] = local.mean(), law.tension_at(local).mean()
    own = {
        "moment_per_width": curve.moment_per_width,
        "change_error": curve.change_error,
        "yarn_tension": tension,
        "yarn_strain": strain,
    }
    points = np.array([curve.centreline_bent(k) for k in range(n)])
    status = status_of(strain, law.breaking_strain, steps)
    return states_dataset(curve, own, points, {"curvature": curve.curvature}, status)


def _relaxed(fabric, law, choice):
    built = solver_fabric(fabric, law, friction=choice["friction"], set_fraction=choice["set"])
    if choice["friction"]:
        built = replace(built, bending_hysteresis=fabric.yarn["bending_hysteresis"])
    return relax(built, resolution_of(fabric))


def _turn(fabric, choice):
    """Largest change of curvature of one step with friction, finer as that of strain; None: bend's."""
    finer = settings_of(fabric).increment / tension.FRICTION_INCREMENT
    return finer * FRICTION_INCREMENT if finer != 1.0 and choice["friction"] else None


def bent(fabric, relaxed, direction, curvatures, choice, variant, **options):
    """The BendingCurve; a curvature that the fabric is too thick for is refused by its key."""
    try:
        curve = bend(
            relaxed, direction, curvatures, spacings=choice["spacings"],
            increment=_turn(fabric, choice), **options,
        )  # fmt: skip
    except InputError as error:
        if error.where != "curvature":
            raise
        key = f"{STAGE}.variants.{variant}.max_curvature_per_cm"
        raise InputError(
            fabric.scene.where(key), f"{from_si(choice['max_curvature'], 'per_cm'):g}",
            f"fabric {fabric.name}: {error.right}",
        ) from error  # fmt: skip
    if not curve.steps:
        raise ComputationError(
            f"bending of {fabric.name}, {direction}, {variant}: no state was reached: "
            f"{curve.stop_reason}"
        )
    return curve


def headlines(fabric, direction):
    """{name: (value, units)} that the ledger follows, without friction and with spacings free.

    What changes 2HB stands in the table of sensitivities.
    """
    law = ledger_laws(fabric.yarn)["continuous"]
    relaxed = relax(solver_fabric(fabric, law), resolution_of(fabric))
    rigidity, curl = rigidity_and_curl(relaxed, direction)
    return {"rigidity B": (rigidity, "N m"), "moment that holds it flat": (curl, "N")}


def run(fabric, laws, direction):
    """(dataset, timings) of a FabricInput bent in one direction; laws: TensionLaw by form."""
    timings = Timings(STAGE, fabric.name)
    law = laws["continuous"]
    choices = fabric.scene[STAGE]["variants"]
    solved, reasons = {}, {}
    for name, choice in choices.items():
        curvatures = curvatures_of(choice)
        with timings.measure(f"{direction}: {name}, with its error estimate"):
            relaxed = _relaxed(fabric, law, choice)
            curve = bent(fabric, relaxed, direction, curvatures, choice, name, estimate_error=True)
        solved[name], reasons[name] = curve, curve.stop_reason
        timings.repeat(
            f"{direction}: {name}, {curve.steps} states from flat",
            partial(bent, fabric, relaxed, direction, curvatures, choice, name),
        )
    steps = max(curve.steps for curve in solved.values())
    states = {
        name: bending_dataset(curve, direction, law, fabric["loop_length"], steps)
        for name, curve in solved.items()
    }
    with timings.measure(f"{direction}: effect of the assumptions"):
        effects = effect_dataset(fabric, closure(STAGE), partial(headlines, direction=direction))
    dataset = variants_dataset(fabric, STAGE, states, reasons, effects)
    describe_stage(
        dataset, fabric, STAGE,
        title=f"Equilibrium bending of {fabric.name}, {direction} direction curved",
        summary="One interlooped yarn in a lattice rolled about a cylinder, in equilibrium in every"
        " state; the moment is that about the mean plane of the centre line.",
        references=("munden",),
    )  # fmt: skip
    return dataset, timings
