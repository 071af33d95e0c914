"""How a fabric curls, read from a bending test: the moment that holds it flat, and where it would rest."""

import math
from dataclasses import dataclass

import numpy as np

from knitsim.kes.bending_test import bending
from knitsim.units import from_si

# Direction that becomes curved: the edges that roll up then, and where plain jersey is known to roll.
NONE = 1e-3  # of B at a curvature of 1 per cm: a moment that is less is the solver's error
EDGES = {"course": ("sides", "back"), "wale": ("top and bottom", "face")}


@dataclass(frozen=True)
class Curl:
    """moment (N), kes_moment (gf cm/cm) that hold the fabric flat, moment_error (N), rolls_to: the side
    of the fabric; curvature (1/m) at which it would rest, curvature_error.  NaN or empty for what the
    curve does not give, why_not then says why, and bound (1/m, is_above) where it lies, if known."""

    moment: float = math.nan
    kes_moment: float = math.nan
    moment_error: float = math.nan
    rolls_to: str = ""
    curvature: float = math.nan
    curvature_error: float = math.nan
    why_not: str = ""
    bound: float = math.nan
    is_above: bool = False


def is_none(moment, rigidity):
    """Whether a moment (gf cm/cm) at no curvature is nothing beside B (gf cm2/cm): face and back alike."""
    return abs(moment) <= NONE * abs(rigidity)


def rolls_to(moment, error):
    """Side to which a fabric rolls that this moment per width (N) holds flat, within its error.

    A positive moment makes the face convex.  Let go, the fabric bends against it: where it takes a
    positive moment to hold the fabric flat, the face becomes hollow, and the edges roll to it.
    """
    if abs(moment) <= error:
        return "neither"
    return "face" if moment > 0.0 else "back"


def curl(curvature, moment_per_width, error, cycle):
    """The :class:`Curl` of a bending test; (n,) each, as :func:`knitsim.kes.bending` takes them.

    error (N): estimated error of the moments.
    """
    found = bending(curvature, moment_per_width, cycle=cycle)
    if "M0" not in found:
        return Curl(why_not=found.left_out["M0"])
    moment, flat = found["M0"], int(np.argmin(np.abs(curvature)))
    # A moment at zero curvature is read between states, unless one is flat.
    between = 0.0 if (curvature == 0.0).any() else np.nan_to_num(moment.error)
    uncertain = error[flat] + between
    known = moment.value, moment.kes_value, uncertain, rolls_to(moment.value, uncertain)
    if "B" in found and is_none(moment.kes_value, found["B"].kes_value):
        return Curl(0.0, 0.0, max(uncertain, abs(moment.value)), "neither", 0.0, 0.0)
    if "K0" in found:
        at = found["K0"]
        near = int(np.argmin(np.abs(curvature - at.value)))
        slope = abs(found["B"].value) if "B" in found else 0.0
        off = error[near] / slope + np.nan_to_num(at.error) if slope else math.nan
        return Curl(*known, at.value, off)
    least, most = moment_per_width.min(), moment_per_width.max()
    if least <= 0.0 <= most:
        return Curl(*known, why_not=found.left_out["K0"])
    # The moment rises with the curvature: what is above zero everywhere is zero further down.
    why = f"moment from {least:.6g} to {most:.6g} N over the whole test, not extrapolated"
    bound = curvature.max() if most < 0.0 else curvature.min()
    return Curl(*known, why_not=why, bound=float(bound), is_above=bool(most < 0.0))


def rest_text(found):
    """Where a fabric of that Curl would rest (1/cm), in words if it is not known."""
    if not math.isnan(found.curvature):
        return f"{from_si(found.curvature, 'per_cm'):.8g}"
    if math.isnan(found.bound):
        return "" if math.isnan(found.moment) else "not reached"
    side = "above" if found.is_above else "below"
    return f"not reached: {side} {from_si(found.bound, 'per_cm'):.6g}"
