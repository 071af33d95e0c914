"""KES bending parameters B, 2HB and the curl of any curve of moment per width against curvature."""

from knitsim.errors import InputError
from knitsim.errors import number as checked_number
from knitsim.kes.result import Collector, LeftOut, shown
from knitsim.kes.sides import add_slope, add_width, window
from knitsim.kes.single_pass import ROUNDING, passes
from knitsim.units import to_si

SLOPE_RANGE = (to_si(0.5, "per_cm"), to_si(1.5, "per_cm"))
HYSTERESIS_AT = to_si(1.0, "per_cm")
# Curvature is positive where the technical face is convex.
SIDES = {"face": 1, "back": -1}
NAMES = ("curvature", "moment_per_width")
_WAYS = {"rising": True, "falling": False}


def bending(
    curvature, moment_per_width, *, cycle=None, number=1, rule="auto", source="", **definition
):
    """KES bending parameters and curl of a whole test: an Evaluation.

    curvature (1/m, positive: technical face convex), moment_per_width (N): (n,) in the order of the
    test, e.g. 0 to +2.5, to -2.5, to 0 per cm; cycle, number, rule, source: as in
    :func:`knitsim.kes.single_pass.passes`, which also says what is refused.  definition: the
    keyword arguments of :func:`bending_of`.
    """
    read = {"names": NAMES, "source": source, "rule": rule, "cycle": cycle, "number": number}
    return bending_of(passes(curvature, moment_per_width, **read), **definition)


def bending_of(
    branches,
    *,
    slope_range=SLOPE_RANGE,
    slope="chord",
    branch="loading",
    hysteresis_at=HYSTERESIS_AT,
):
    """KES bending parameters and curl of a list of :class:`knitsim.kes.single_pass.Pass`.

    B (N m; gf cm2/cm): mean slope of the moment over slope_range (1/m), 0.5 to 1.5 per cm in S.
    Kawabata, The Standardization and Analysis of Hand Evaluation, 2nd ed., 1980.  slope: ``chord``
    (between the ends of the range) or ``fit`` (least squares of the curve over the range).  branch:
    ``loading`` (away from zero curvature), ``recovery``, or the ``mean`` of both.
    2HB (N; gf cm/cm): width of the loop, rising minus falling curvature, at the curvature
    hysteresis_at (1/m): 1.0 per cm; a pair (low, high) means the mean width over that range.
    B and 2HB are given for curvatures above 0 (_face: the face is convex), below (_back), and as
    the mean of both under the plain name.  A test of one pass counts as loading and recovery, and
    has no 2HB.

    Curl: M0 (N), the moment at zero curvature, and K0 (1/m), the curvature at zero moment where the
    moment rises with the curvature, so that the fabric rests there; of several the one nearest to
    zero.  Both for _rising and _falling curvature and as their mean; M0_start is the moment of the
    fabric before a test that starts flat, and M0 is then that.  A curve that does not come to zero
    moment gives the bound in the reason.

    Raises InputError for a definition that makes no sense.
    """
    read = window(slope_range, branch, slope, "curvature")
    at = _hysteresis_range(hysteresis_at)
    found = Collector()
    add_slope(found, "B", "rigidity", SIDES, branches, read)
    add_width(found, "2HB", "moment", SIDES, branches, at, "curvature")
    _flat_moment(found, branches)
    _curl(found, branches)
    return found.result(f"pass {k}: {one}" for k, one in enumerate(branches, start=1))


def _hysteresis_range(at):
    if not isinstance(at, (tuple, list)):
        return checked_number("hysteresis_at", at, 0.0)
    if len(at) != 2:
        raise InputError("hysteresis_at", at, "must be a curvature or a pair of them (1/m)")
    low = checked_number("hysteresis_at[0]", at[0], 0.0, low_allowed=True)
    return low, checked_number("hysteresis_at[1]", at[1], low)


def _starts_flat(branches):
    first = branches[0]
    return abs(first.start) <= ROUNDING * max(abs(first.low), abs(first.high))


def _both(found, name, kind, branches, text):
    """Add the mean of name_rising and name_falling, or the one that a test of one way has."""
    ways = [way for way, rising in _WAYS.items() if any(b.rising == rising for b in branches)]
    of = " and ".join(ways)
    found.add(
        name, kind, lambda: found.mean(*(f"{name}_{way}" for way in ways)),
        f"{text}, {'mean of ' if len(ways) > 1 else ''}{of} curvature",
    )  # fmt: skip


def _flat_moment(found, branches):
    text = "moment at zero curvature"
    flat = _starts_flat(branches)
    for way, rising in _WAYS.items():
        # The first pass of a test that starts flat has not yet bent the fabric at zero curvature.
        later = [b for b in branches[1 if flat else 0 :] if b.rising == rising]

        def compute(later=later, way=way):
            for one in later:
                if one.covers(0.0, 0.0):
                    return one.value(0.0)
            raise LeftOut(f"no {way} pass comes to zero curvature after bending")

        found.add(f"M0_{way}", "moment", compute, f"{text}, {way} curvature")
    if flat:
        for name in ("M0_start", "M0"):
            found.add(
                name, "moment", lambda: branches[0].value(branches[0].start),
                f"{text}, flat, before bending",
            )  # fmt: skip
        return
    _both(found, "M0", "moment", branches, text)


def _curl(found, branches):
    text = "curvature at zero moment"
    for way, rising in _WAYS.items():
        there = [b for b in branches if b.rising == rising]

        def compute(there=there, way=way):
            for one in there:
                zeros = one.rising_zeros()
                if zeros:
                    return min(zeros, key=lambda zero: abs(zero[0]))
            raise LeftOut(_not_reached(there, way))

        found.add(f"K0_{way}", "curvature", compute, f"{text}, {way} curvature")
    _both(found, "K0", "curvature", branches, text)


def _not_reached(there, way):
    """Why passes of one way give no curvature at zero moment, with the bound."""
    if not there:
        return f"the test has no pass with {way} curvature"
    low, high = min(b.low for b in there), max(b.high for b in there)
    least, most = min(b.y.min() for b in there), max(b.y.max() for b in there)
    over = shown((low, high), "curvature")
    if least > 0.0:
        where = f"if anywhere, it lies below {shown(low, 'curvature')}"
    elif most < 0.0:
        where = f"if anywhere, it lies above {shown(high, 'curvature')}"
    elif least == most:
        return f"the moment is zero throughout, {over}"
    else:
        where = "the moment does not pass from below to above zero there as the curvature rises"
    moments = shown((least, most), "moment")
    return f"not reached with {way} curvature: over {over} the moment is {moments}; {where}"
