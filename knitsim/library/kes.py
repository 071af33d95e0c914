"""What the Kawabata instruments read of a test."""

from __future__ import annotations

from typing import Any

import numpy as np

from knitsim import kes as room
from knitsim.errors import InputError
from knitsim.kes.result import Evaluation
from knitsim.library.curves import Bent, Pulled, Sheared
from knitsim.measured.test import MeasuredTest
from knitsim.units import to_si


def kes(
    result: Pulled | Bent | Sheared | MeasuredTest, *, to_force_gf_per_cm: float | None = None
) -> Evaluation:
    """KES parameters of a test, computed or measured, each with its unit, definition and error.

    Of a pull EMT, LT, WT and, with recovery, RT, up to ``to_force_gf_per_cm``: 50 gf/cm, the knit condition,
    if the test comes so far, else the largest force of the first loading.  Of bending B, 2HB and curl, of
    shear G, 2HG, 2HG5.  Tests that were read by :func:`knitsim.read_measured` are taken as well.  After
    S. Kawabata, The Standardization and Analysis of Hand Evaluation, 2nd ed., 1980.

    >>> import knitsim as ks
    >>> fabric = ks.Fabric(ks.Yarn(count_tex=19.7, bending_rigidity_N_mm2=2e-3), loop_length_mm=2.9)
    >>> found = ks.kes(ks.pull(fabric, "course", to_force_gf_per_cm=50, recovery=True))
    >>> found  # doctest: +ELLIPSIS
    <KES at 50 gf/cm: EMT 27.7 %, WT 7.35 gf cm/cm2, LT 1.06, residual_strain 9.49 %, ...>
    >>> round(found["EMT"].value, 3), found["EMT"].units
    (0.277, '1')
    """
    if to_force_gf_per_cm is not None and not to_force_gf_per_cm > 0:
        raise InputError("kes.to_force_gf_per_cm", to_force_gf_per_cm, "must be above 0")
    found: Evaluation
    if isinstance(result, MeasuredTest):
        return _of_measured(result, to_force_gf_per_cm)
    if isinstance(result, Pulled):
        force = _force(to_force_gf_per_cm, result.force_per_width)
        found = room.tension(
            result.strain, result.force_per_width, phase=result.curve.phase, cycle=result.curve.cycle,
            max_force=force,
        )  # fmt: skip
    elif isinstance(result, Bent):
        found = room.bending(result.curvature, result.moment_per_width, cycle=result.curve.cycle)
    elif isinstance(result, Sheared):
        found = room.shear(result.angle, result.force_per_width)
    else:
        raise InputError("kes", repr(result), "needs a pull, a bend, a shear or a measured test")
    return found


def _of_measured(test: MeasuredTest, to_force_gf_per_cm: float | None) -> Evaluation:
    found: Evaluation
    if test.kind == "tension":
        force = _force(to_force_gf_per_cm, test["force_per_width"])
        found = room.tension(
            test["strain"], test["force_per_width"], phase=test.phase, max_force=force
        )
    elif test.kind == "bending":
        found = room.bending(test["curvature"], test["moment_per_width"])
    else:
        raise InputError("kes", test.kind, "must be a measured tension or bending test of a fabric")
    return found


def _force(stated: float | None, forces: Any) -> float:
    """The force (N/m) up to which a tension test is read."""
    if stated is not None:
        return float(to_si(stated, "gf_per_cm"))
    largest = float(np.max(forces))
    return (
        room.KNIT_FORCE if largest >= room.KNIT_FORCE * (1.0 - room.tensile_test.NEAR) else largest
    )
