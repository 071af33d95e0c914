"""Pure bending of the fabric: moment per width against curvature, no friction.

The bent direction ("course" or "wale") becomes the circumference of a cylinder; curvature is positive
when the technical face is convex.  The moment is the derivative of the energy per area by the
curvature, about the mean plane of the centre line.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.equilibrium.friction_kernels import no_slip
from knitsim.equilibrium.model import Model
from knitsim.equilibrium.newton_kernels import CONVERGED, energy_of, minimise, new_work, pairs_at
from knitsim.equilibrium.path_kernels import CROSSINGS_LOST
from knitsim.equilibrium.relax import REASONS, is_intact
from knitsim.equilibrium.scene import Bend
from knitsim.errors import InputError

DIRECTIONS = {"course": 0, "wale": 1}
INCREMENT = 100.0  # 1/m, largest change of curvature in one solve
SMALLEST = INCREMENT / 64.0
TIGHTEST = 0.5  # curvature times half the thickness, yarn included


@dataclass(frozen=True, eq=False)
class BendingCurve:
    """States of a bending test in the order visited; arrays (steps,) unless said.

    curvature (1/m), moment_per_width (N), wale_spacing, course_spacing (m, in the mean plane),
    energy (steps, 3) per loop (J), min_distance (diameters), residual (N), iterations, y.
    """

    model: Model
    direction: str
    curvature: np.ndarray
    moment_per_width: np.ndarray
    wale_spacing: np.ndarray
    course_spacing: np.ndarray
    energy: np.ndarray
    min_distance: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    y: np.ndarray
    stop_reason: str

    @property
    def crossings_intact(self):
        """Crossings of each state as in plain knit (in the coordinates of the fabric)."""
        return np.array([is_intact(self.model, y) for y in self.y])


def bend(relaxed, direction, curvatures, *, spacings="free"):
    """Bend the relaxed fabric through ``curvatures`` (1/m), in that order; a :class:`BendingCurve`.

    spacings: "free" or "held" (at the relaxed ones).  Friction is left out.  Raises InputError for
    names that make no sense and curvatures tighter than the fabric is thick.
    """
    if direction not in DIRECTIONS:
        raise InputError("direction", direction, "must be course or wale")
    if spacings not in ("free", "held"):
        raise InputError("spacings", spacings, "must be free or held")
    curvatures = np.atleast_1d(np.asarray(curvatures, dtype=float))
    half = np.abs(relaxed.centreline[:, 2]).max() + 0.5 * relaxed.model.fabric.diameter
    if not (np.abs(curvatures) * half <= TIGHTEST).all():
        raise InputError(
            "curvature",
            float(np.abs(curvatures).max()),
            f"must be finite and {TIGHTEST / half:.4g} 1/m or less: the fabric is too thick for it",
        )
    model = relaxed.model
    free = model.free(0, 3) if spacings == "free" else model.free()
    work = new_work(model.scene)
    at, y, reached, reason, rows = model.lattice, relaxed.y.copy(), 0.0, "", []
    for wanted in curvatures:
        step, total = INCREMENT, 0
        while not reason:
            kappa = reached + np.clip(wanted - reached, -step, step)
            scene = model.scene._replace(bend=Bend(float(kappa), DIRECTIONS[direction], True))
            trial = y.copy()
            status, used, residual = minimise(scene, trial, free, no_slip(), model.control, work)
            total += used
            if status == CONVERGED and not is_intact(model, trial):
                status = CROSSINGS_LOST
            if status == CONVERGED:
                y, reached = trial, kappa
                if kappa == wanted:
                    break
            else:
                step *= 0.5
                if step < SMALLEST:
                    reason = f"{REASONS[status]}; stopped before curvature {wanted:.6g} 1/m"
        if reason:
            break
        # The derivative by the curvature is a by-product of the last evaluation, at y.
        energy_of(scene, y, pairs_at(scene, y, 0.0, work), no_slip(), 1, work)
        area = y[at] * y[at + 3] * model.loops
        rows.append(
            (
                wanted,
                work.by_kappa[0] / area,
                work.terms / model.loops,
                np.sqrt(work.closest[0]) / model.fabric.diameter,
                residual,
                total,
                y.copy(),
            )
        )
    kappa, moment, terms, closest, residual, used, states = (
        (np.array(column) for column in zip(*rows, strict=True))
        if rows
        else (np.empty(0),) * 3 + (np.empty(0),) * 3 + (np.empty((0, len(y))),)
    )
    return BendingCurve(
        model,
        direction,
        kappa,
        moment,
        states[:, at],
        states[:, at + 3],
        terms,
        np.where(np.isfinite(closest), closest, np.nan),
        residual,
        used,
        states,
        reason,
    )
