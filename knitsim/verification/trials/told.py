"""What the judge is told of a result: a case's inputs, the states of a curve, what was asked."""

import numpy as np

from knitsim.equilibrium import spline
from knitsim.equilibrium.cell import loops_of
from knitsim.equilibrium.contact import BarrierContact, CoreContact
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.relax import relax
from knitsim.verification.judge.given import Core, Given
from knitsim.verification.judge.verdict import States, Test
from knitsim.yarn.law import TensionLaw

_ACROSS = {"course": 3, "wale": 0}  # entry of the lattice across the pull


def fabric_of(case):
    """The solver's Fabric of a Case."""
    contact = case.contact
    if isinstance(contact, Core):
        contact = CoreContact(contact.core, contact.stiffness, contact.exponent)
    else:
        contact = BarrierContact(contact.stiffness)
    return Fabric(
        case.wale_spacing, case.course_spacing, case.loop_length, case.diameter,
        case.bending_rigidity, TensionLaw(case.law_strain, case.law_tension, case.law_strain[-1]),
        contact, case.friction, case.set_fraction, case.bending_hysteresis, case.tangential_ratio,
        pattern=case.pattern,
    )  # fmt: skip


def relaxed_of(case):
    """The relaxed fabric of a Case."""
    size = Resolution(case.points, case.contacts, case.cell, case.wales, case.courses)
    return relax(fabric_of(case), size)


def given_of(case, relaxed):
    """What the judge is told of a Case and of how finely it was solved: as the state at rest was."""
    model, cell, held = relaxed.model, relaxed.model.cell, None
    if case.set_fraction > 0.0:
        held = lines_of(model, model.held), lattice_of(model, model.held)
    return Given(
        case.loop_length, case.diameter, case.bending_rigidity, case.law_strain, case.law_tension,
        case.contact, case.friction, cell.points, cell.contacts, cell.wales, cell.courses,
        model.fabric.pattern.rows, set_fraction=case.set_fraction, held=held,
        bending_hysteresis=case.bending_hysteresis, tangential_ratio=case.tangential_ratio,
    )  # fmt: skip


def lattice_of(model, y):
    """The spacings (..., 4) of unknowns (..., n)."""
    return y[..., model.lattice : model.lattice + 4]


def lines_of(model, y):
    """Centre lines (courses, m + 1, 3), m, of all courses of a cell, two samples per span."""
    cell, lattice = model.cell, lattice_of(model, y)
    step = cell.wales * np.array([lattice[0], lattice[1], 0.0])
    yarns = loops_of(cell, y)
    spans = yarns.shape[1]
    u = np.arange(2 * spans + 1) / 2.0
    return np.array(
        [spline.evaluate(np.concatenate([c[-1:] - step, c, c[:2] + step]), u) for c in yarns]
    )


def rest_of(relaxed):
    """States of a fabric at rest alone."""
    return _states(relaxed, {}, 1)


def _states(relaxed, columns, count):
    """The judge's States from columns (count, ...) of values; what is not named is as at rest."""
    y = relaxed.y[None]
    rest = {
        "centreline": lines_of(relaxed.model, relaxed.y)[None],
        "lattice": lattice_of(relaxed.model, y), "curvature": 0.0, "coordinate": np.zeros((1, 0)),
        "load": _left_of(relaxed.model), "moment": np.nan, "energy": relaxed.energy[None, :3], "sprung": 0.0,
        "work": 0.0, "dissipated": 0.0, "increments": 1, "min_distance": relaxed.min_distance,
        "numerical_error": np.nan,
    }  # fmt: skip
    values = {}
    for name, value in rest.items():
        value = np.atleast_1d(value)
        values[name] = columns.get(name, np.broadcast_to(value, (count, *value.shape[1:])))
    return States(**values)


def _left_of(model):
    """Loads (1, 4) told of a fabric at rest: none on its spacings; what keeps it from skewing where it has no
    mirror is not told.
    """
    mirrored = any(one.sign[0] != one.sign[1] for one in model.cell.symmetries)
    mirrored |= model.fabric.pattern.uniform
    return np.array([[0.0, 0.0, 0.0, 0.0] if mirrored else [0.0, np.nan, np.nan, 0.0]])


def states_of(asked, relaxed, curve):
    """The judge's States of a Curve or BendingCurve of a test."""
    model = curve.model
    columns = {
        "centreline": np.array([lines_of(model, y) for y in curve.y]),
        "lattice": lattice_of(model, curve.y), "energy": curve.energy[:, :3], "work": curve.work,
        "sprung": curve.energy[:, 3],
        "dissipated": curve.dissipated, "min_distance": curve.min_distance,
        "numerical_error": curve.numerical_error, "increments": curve.increments,
    }  # fmt: skip
    if asked.kind == "bending":
        columns |= {
            "curvature": curve.curvature, "coordinate": curve.curvature[:, None],
            "moment": curve.moment_per_width, "load": np.full((curve.steps, 4), np.nan),
        }  # fmt: skip
        return _states(relaxed, columns, curve.steps)
    both = (curve.strain, curve.wale_strain) if asked.kind == "biaxial" else (curve.strain,)
    columns |= {"coordinate": np.stack(both, axis=1), "load": curve.forces}
    states = _states(relaxed, columns, curve.steps)
    if _loaded(asked):
        return states
    # Unloaded, the way starts in the state at rest.
    rest = _states(relaxed, {"coordinate": np.zeros((1, len(both)))}, 1)
    return States(**{n: np.concatenate([getattr(rest, n), v]) for n, v in vars(states).items()})


def _loaded(asked):
    return not isinstance(asked.lateral, str) or asked.tension != 0.0


def wanted_of(asked, relaxed, curve):
    """The judge's Test; at rest where nothing is asked."""
    if asked is None:
        return Test()
    lattice, lateral = lattice_of(relaxed.model, relaxed.y), asked.lateral
    dead, held, driven = np.zeros(4), {1, 2}, (asked.direction,)
    if asked.kind == "bending":
        driven = (asked.name,)
        held |= {0, 3} if lateral == "held" else set()
    elif asked.kind == "biaxial":
        driven = ("course", "wale")
    elif asked.kind == "shear":
        driven, held = ("shear",), {1} | ({0} if lateral == "held" else set())
        dead[3] = asked.tension * lattice[0]
    else:
        across = _ACROSS[asked.direction]
        held |= {across} if lateral == "held" else set()
        if not isinstance(lateral, str):
            dead[across] = lateral * lattice[3 - across]
    first = int(asked.kind != "bending" and not _loaded(asked))  # whether it starts at rest
    path = np.reshape(asked.path, (len(asked.path), -1))
    wanted = np.concatenate([np.zeros((first, path.shape[1])), path])
    # The last state of each way back that was not stopped.
    ends = np.flatnonzero(np.diff(curve.phase, append=0) < 0) if asked.cycles else []
    stopped = len(curve.phase) - 1 if curve.stop_reason else -1
    return Test(
        driven, tuple(sorted(held)), dead, None if curve.stop_reason else wanted,
        lattice if _loaded(asked) else None, tuple(int(i) + first for i in ends if i != stopped),
        asked.increment is None,
    )  # fmt: skip
