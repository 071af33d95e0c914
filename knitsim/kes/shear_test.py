"""KES shear parameters G, 2HG, 2HG5 of any curve of shear force per width against shear angle."""

from knitsim.kes.result import Collector
from knitsim.kes.sides import add_slope, add_width, window
from knitsim.kes.single_pass import passes
from knitsim.units import to_si

SLOPE_RANGE = (to_si(0.5, "deg"), to_si(2.5, "deg"))
HYSTERESIS_AT = {"2HG": to_si(0.5, "deg"), "2HG5": to_si(5.0, "deg")}
SIDES = {"plus": 1, "minus": -1}
NAMES = ("angle", "force_per_width")


def shear(angle, force_per_width, *, cycle=None, number=1, rule="auto", source="", **definition):
    """KES shear parameters of a whole test: an Evaluation.

    angle (rad), force_per_width (N/m): (n,) in the order of the test, e.g. 0 to +8, to -8, to 0
    degrees; cycle, number, rule, source: as in :func:`knitsim.kes.single_pass.passes`, which
    also says what is refused.  definition: the keyword arguments of :func:`shear_of`.
    """
    read = {"names": NAMES, "source": source, "rule": rule, "cycle": cycle, "number": number}
    return shear_of(passes(angle, force_per_width, **read), **definition)


def shear_of(branches, *, slope_range=SLOPE_RANGE, slope="chord", branch="loading"):
    """KES shear parameters of a list of :class:`knitsim.kes.single_pass.Pass`.

    G (N m-1 rad-1; gf/(cm deg)): mean slope over slope_range (rad), 0.5 to 2.5 degrees in S.
    Kawabata, The Standardization and Analysis of Hand Evaluation, 2nd ed., 1980.  2HG, 2HG5 (N m-1;
    gf/cm): width of the loop, rising minus falling angle, at 0.5 and 5 degrees.  Each for angles
    above 0 (_plus) and below (_minus), and the mean of both under the plain name.
    slope, branch: as in :func:`knitsim.kes.bending_test.bending_of`.
    """
    found = Collector()
    read = window(slope_range, branch, slope, "angle")
    add_slope(found, "G", "shear_rigidity", SIDES, branches, read)
    for name, at in HYSTERESIS_AT.items():
        add_width(found, name, "force", SIDES, branches, at, "angle")
    return found.result(f"pass {k}: {one}" for k, one in enumerate(branches, start=1))
