"""Curl of a fabric: what holds it flat, and how far it rolls up when let go.

A fabric at rest and flat is held by the moment M0 (moment per width at zero curvature, positive if it
makes the face convex).  Let go it bends until the moment is zero.  As the moment rises with the
curvature, it bends to the side against M0: with M0 below zero the face becomes convex and the edge
rolls to the back, as plain jersey does along its sides (course direction curved); with M0 above zero it
rolls to the face, as at top and bottom (wale direction curved).
"""

from dataclasses import dataclass

import numpy as np

from knitsim.equilibrium.curve import LOADING
from knitsim.errors import InputError

EDGES = {"course": "sides", "wale": "top and bottom"}


@dataclass(frozen=True)
class Curl:
    """Curl of one direction.

    edges: the edges that roll, "sides" (parallel to the wales) or "top and bottom" (parallel to the
    courses); moment (N): moment per width that holds the fabric flat; rolls_to: "back", "face" or
    "neither"; curvature (1/m): where the moment is zero, or None if the test did not get there;
    bound (1/m): then the curvature lies beyond this one, reached on the side that it rolls to (0 if
    the test did not go to that side), else None.
    """

    direction: str
    edges: str
    moment: float
    rolls_to: str
    curvature: float | None
    bound: float | None


def curl_of(curve):
    """:class:`Curl` of a BendingCurve that starts from the flat fabric.

    The curvature at zero moment is interpolated between two neighbouring states of the first loading
    to the side that the fabric rolls to, never extrapolated.  Raises InputError for a curve without
    states.
    """
    if not len(curve.curvature):
        raise InputError("curve", curve.stop_reason, "must have states: nothing was reached")
    moment = float(curve.flat_moment)
    edges = EDGES[curve.direction]
    if moment == 0.0:
        return Curl(curve.direction, edges, moment, "neither", 0.0, None)
    side = -np.sign(moment)
    rolls_to = "back" if side > 0.0 else "face"
    outward = (curve.phase == LOADING) & (curve.cycle == 1) & (side * curve.curvature > 0.0)
    curvature = np.concatenate([[0.0], curve.curvature[outward]])
    moments = np.concatenate([[moment], curve.moment_per_width[outward]])
    there = np.flatnonzero(side * moments >= 0.0)
    if not len(there):
        return Curl(curve.direction, edges, moment, rolls_to, None, float(curvature[-1]))
    k = there[0]
    share = moments[k - 1] / (moments[k - 1] - moments[k])
    zero = curvature[k - 1] + share * (curvature[k] - curvature[k - 1])
    return Curl(curve.direction, edges, moment, rolls_to, float(zero), None)
