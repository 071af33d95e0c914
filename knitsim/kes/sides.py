"""Slope and hysteresis of a test to both sides of zero, as bending and shear are evaluated.

A side is +1 (abscissa above 0) or -1.  On either side a pass that leads away from zero is loading,
one that leads back is recovery; the width of the loop is rising minus falling pass on both sides.
"""

from dataclasses import dataclass

from knitsim.errors import InputError, number
from knitsim.kes.result import LeftOut, shown

BRANCHES = ("loading", "recovery", "mean")
FORMS = ("chord", "fit")
NOISE = 1e-7  # of the largest value: the solver's forces are exact to 1e-8 of it


@dataclass(frozen=True)
class Window:
    """What is read: the range of the slope (low to high, above 0), the branch (BRANCHES), the form
    of the slope (FORMS).  kind: of the abscissa, "curvature" or "angle"."""

    low: float
    high: float
    branch: str
    form: str
    kind: str

    @property
    def text(self):
        """The definition in words."""
        branch = "mean of loading and recovery" if self.branch == "mean" else self.branch
        form = {"chord": "mean slope", "fit": "least-squares slope of the curve"}[self.form]
        return f"{form} from {shown((self.low, self.high), self.kind)}, {branch}"


def window(slope_range, branch, form, kind):
    """A checked :class:`Window`."""
    try:
        low, high = slope_range
    except (TypeError, ValueError):
        raise InputError("slope_range", slope_range, "must be a pair of numbers") from None
    low = number("slope_range[0]", low, 0.0, low_allowed=True)
    high = number("slope_range[1]", high, low)
    if branch not in BRANCHES:
        raise InputError("branch", branch, f"must be one of {', '.join(BRANCHES)}")
    if form not in FORMS:
        raise InputError("slope", form, f"must be one of {', '.join(FORMS)}")
    return Window(low, high, branch, form, kind)


def side_slope(passes, side, read):
    """(slope, error) on one side over a Window; raises LeftOut.

    A test of a single pass has no hysteresis to tell loading from recovery by: it counts as both.
    """
    low, high = sorted((side * read.low, side * read.high))
    found = []
    for branch in ("loading", "recovery") if read.branch == "mean" else (read.branch,):
        one = passes[_find(passes, side, branch, low, high, read.kind)]
        found.append(_slope(one, low, high, read.form))
    return tuple(sum(column) / len(found) for column in zip(*found, strict=True))


def _slope(one, low, high, form):
    if form == "chord":
        (a, a_error), (b, b_error) = one.value(low), one.value(high)
        return (b - a) / (high - low), (a_error + b_error) / (high - low)
    scale = 12.0 / (high - low) ** 3
    moment, error = one.first_moment(low, high)
    return scale * moment, scale * error


def side_width(passes, side, at, kind):
    """(width of the loop, error) on one side; raises LeftOut.

    at: the abscissa (above 0), or a range (low, high) over which the mean width is taken.  A width below
    NOISE of the largest value is none: it is what rounding and the solver's tolerance leave.
    """
    low, high = at if isinstance(at, tuple) else (at, at)
    low, high = sorted((side * low, side * high))
    out = _find(passes, side, "loading", low, high, kind)
    back = _find(passes, side, "recovery", low, high, kind, out)
    if out == back:
        raise LeftOut("the test has a single pass, no recovery")
    found = []
    for one in (passes[out], passes[back]):
        value, error = one.value(low) if low == high else one.integral(low, high)
        found.append((value, error))
    scale = side if low == high else side / (high - low)
    width, error = scale * (found[0][0] - found[1][0]), abs(scale) * (found[0][1] + found[1][1])
    noise = NOISE * max(float(abs(one.y).max()) for one in (passes[out], passes[back]))
    return (width, error) if abs(width) > noise else (0.0, max(error, noise))


def _find(passes, side, branch, low, high, kind, after=-1):
    """Index of the pass of a branch that covers low to high: the first behind the pass ``after``,
    or, in a loop that begins with its recovery, the first of all."""
    if len(passes) == 1 and passes[0].covers(low, high):
        return 0
    rising = (side > 0) == (branch == "loading")
    fitting = [k for k, one in enumerate(passes) if one.rising == rising and one.covers(low, high)]
    if fitting:
        return next((k for k in fitting if k > after), fitting[0])
    way = "rising" if rising else "falling"
    there = [one for one in passes if one.rising == rising]
    wanted = shown((low, high) if low != high else low, kind)
    if not there:
        raise LeftOut(f"the test has no pass with {way} {kind}, the {branch} at {wanted}")
    reach = " and ".join(shown((one.low, one.high), kind) for one in there)
    raise LeftOut(f"no {branch} at {wanted}: with {way} {kind} the test covers {reach}")


def add_slope(found, name, kind, sides, passes, read):
    """Add the slope on both ``sides`` ({label: side}) and their mean, as ``name``, to a Collector."""
    for label, side in sides.items():
        found.add(
            f"{name}_{label}", kind,
            lambda side=side: side_slope(passes, side, read), f"{read.text}, {label} side",
        )  # fmt: skip
    both = [f"{name}_{label}" for label in sides]
    found.add(name, kind, lambda: found.mean(*both), f"{read.text}, mean of both sides")


def add_width(found, name, kind, sides, passes, at, axis):
    """Add the width of the loop, as :func:`add_slope` does; at, axis: as in :func:`side_width`."""
    if isinstance(at, tuple):
        text = f"mean width of the loop from {shown(at, axis)}"
    else:
        text = f"width of the loop at {shown(at, axis)}"
    for label, side in sides.items():
        found.add(
            f"{name}_{label}", kind,
            lambda side=side: side_width(passes, side, at, axis), f"{text}, {label} side",
        )  # fmt: skip
    both = [f"{name}_{label}" for label in sides]
    found.add(name, kind, lambda: found.mean(*both), f"{text}, mean of both sides")
