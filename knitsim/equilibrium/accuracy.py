"""How far off the forces and moments of a test are, and how to get them to an accuracy: one rule for all.

A test is solved on one rung of a ladder of resolutions and on the next.  What changes from the one to the
other tells the error of the finer: that of the control points falls with the 6th to 7th power of their
number, that of the contact points with the 4th (measured), so that from a rung to the next the error
falls more than threefold and the finer lacks less than half of the change; LACKING of it is said.  With
friction, where contact points stick or slide one by one, the change itself is taken; below SETTLED
control points what an error in proportion to their distance would make of it.  What is left wavers along
the test; at each state the largest change of its neighbourhood stands.  With friction the test is also
solved, on the coarser rung, in steps twice as long; the law is stepped implicitly, and its error falls at
least in proportion to the step.

Where an accuracy is asked for, rungs are climbed and steps halved until the estimate is met.
"""

from dataclasses import replace

import numpy as np

from knitsim.equilibrium.fabric import LEAST_POINTS, Resolution
from knitsim.equilibrium.model import build_model, resampled, with_set
from knitsim.equilibrium.relax import MOST_CONTACTS, TOO_CLOSE, refining, released, settle
from knitsim.equilibrium.result import BendingCurve
from knitsim.errors import ComputationError, InputError
from knitsim.store.tensile import SMALLEST_OF_LARGEST, counted_error, counted_scale

# Control points a loop, and contact points over those of the contact law's rule.
LADDER = ((48, 1.0), (72, 1.5), (112, 2.5), (168, 3.8), (248, 5.6))
SETTLED, LACKING = 64, 0.7  # control points from which on an error is this part of the last change
AROUND = 4  # states on either side whose error may stand for a state
DENSER = 1.5  # contact points where those there are stand too far apart
UNLIKE = 1.2  # ratio of contact points from which on two solutions tell their error
MOST_DENSE = 4.0  # contact points a test may end with, over those it began with
SHARE = 0.5  # of the error asked for that is left to the increments, with friction
HALVINGS = 5  # of the increment, at most
STEPPED = 2.0  # times what changes with half the increment: contacts stick or slide one by one
LOOSEST, TIGHTEST = 0.5, 1e-6  # accuracies that may be asked for
NEAR = 0.05  # of strain: how far the ends of two ways to a force may lie apart


def resolution_at(fabric, rung, like):
    """The Resolution of a rung for a fabric; like: another, whose kind of cell is kept."""
    points, share = LADDER[rung]
    rule = Resolution(points=LEAST_POINTS).contacts_for(fabric)
    contacts = 4 * int(np.ceil(max(share * rule, 2 * points) / 4.0))
    if (like.points, like.contacts_for(fabric)) == (points, contacts):
        return like
    return replace(like, points=points, contacts=contacts)


def coarser(resolution, fabric):
    """The Resolution one rung below any."""
    return _scaled(resolution, fabric, 1.0 / 1.5)


def finer(resolution, fabric):
    """The Resolution one rung above any."""
    return _scaled(resolution, fabric, 1.5)


def other_than(resolution, fabric):
    """The Resolution that tells the error of one: a rung below, or above where none lies below."""
    below = coarser(resolution, fabric)
    return below if below.points < resolution.points else finer(resolution, fabric)


def _scaled(resolution, fabric, factor):
    points = max(LEAST_POINTS, 4 * round(factor * resolution.points / 4.0))
    contacts = 4 * round(factor * resolution.contacts_for(fabric) / 4.0)
    return replace(resolution, points=points, contacts=max(contacts, 2 * points))


def at_resolution(relaxed, resolution):
    """The relaxed state solved again at another resolution, from the same shape."""
    if resolution == relaxed.model.resolution:
        return relaxed

    def run(contacts, _):
        return _at_resolution(relaxed, replace(resolution, contacts=contacts))

    if resolution not in relaxed.others:
        relaxed.others[resolution] = refining(run, resolution.contacts)
    return relaxed.others[resolution]


def _at_resolution(relaxed, resolution):
    model = relaxed.model
    other = build_model(model.fabric, resolution, model.cell.symmetries)
    if model.held is not None:
        # The rest curvature belongs to the held loop, which must be found again.
        held = settle(other, resampled(model, model.held, other), other.free())
        other = with_set(other, held.y)
    state = released(settle(other, resampled(model, relaxed.y, other), other.free(0, 3)))
    if not relaxed.history:
        return state
    from knitsim.equilibrium.programme import handled

    return handled(state, relaxed.history)


def rest_to(relaxed, accuracy=None):
    """The state at rest with its spacings to an accuracy, and their estimated relative error.

    accuracy: None for the resolution that it has.  The error is NaN where no other resolution comes to
    rest.  Raises InputError for an accuracy out of range.
    """
    model = relaxed.model
    if accuracy is None:
        return relaxed, _apart(relaxed, other_than(model.resolution, model.fabric))
    error = np.nan
    for rung in range(1, len(LADDER)):
        below, resolution = (
            resolution_at(model.fabric, n, model.resolution) for n in (rung - 1, rung)
        )
        try:
            finer = at_resolution(relaxed, resolution)
        except ComputationError:
            continue
        error, found = _apart(finer, below), finer
        if error <= _checked(accuracy):
            return found, error
    return relaxed if np.isnan(error) else found, error


def _apart(relaxed, resolution):
    """Estimated relative error of the relaxed spacings, by another resolution."""
    try:
        other = at_resolution(relaxed, resolution)
        if not _differ(relaxed.model, other.model):
            other = at_resolution(relaxed, _above(relaxed.model))
    except ComputationError:
        return np.nan
    return _part(relaxed.model, other.model) * max(
        abs(other.wale_spacing / relaxed.wale_spacing - 1.0),
        abs(other.course_spacing / relaxed.course_spacing - 1.0),
    )


def _part(model, other):
    """Which part of the change from the model of another resolution the error is at most."""
    points, others = model.cell.points, other.cell.points
    if points < SETTLED:
        return others / abs(points - others)
    # Of a change to the finer, what the finer lacks comes to it.
    return (1.0 if model.rub else LACKING) + float(others > points)


def _checked(accuracy):
    if not TIGHTEST <= accuracy <= LOOSEST:
        raise InputError("accuracy", accuracy, f"must be between {TIGHTEST:g} and {LOOSEST:g}")
    return accuracy


def solved(relaxed, run, increment, accuracy=None, estimate_error=False, refine=True):
    """A test solved once, or with its error estimated, or to an accuracy.

    run(relaxed, increment): the test; its result has ``place`` and ``value`` (:class:`.result.States`).
    increment: largest step with friction.  accuracy: largest estimated error (1) that is asked for, None
    for none; estimate_error: whether the error is estimated where no accuracy is asked for, at the
    resolution of the relaxed state; refine: whether contact points are added where neither is asked for.
    The error stays unknown, NaN, where no other resolution than that of the result could be solved.
    Where the last rung does not reach the accuracy, the result is that of the last rung, and its error says
    how near it came.

    Raises InputError for an accuracy out of range, ComputationError as the test does.
    """
    model = relaxed.model
    if accuracy is None:
        if not estimate_error:
            return _fine(run, relaxed, increment, refine)[0]
        rungs = [other_than(model.resolution, model.fabric), model.resolution]
        accuracy = np.inf
    else:
        _checked(accuracy)
        rungs = [resolution_at(model.fabric, n, model.resolution) for n in range(len(LADDER))]
    coarse, steps, failure, found, alike = None, None, None, None, False
    for resolution in rungs:
        try:
            curve, start = _fine(run, at_resolution(relaxed, resolution), increment)
            if model.rub and steps is None:
                curve, increment, steps = _stepped(start, run, increment, curve, accuracy)
        except ComputationError as error:
            failure = error
            continue
        known = coarse is not None and _differ(coarse.model, curve.model)
        found = _with_errors(curve, coarse, steps) if known else curve
        if known and largest_error(found) <= accuracy:
            break
        coarse, alike = curve, coarse is not None and not known
    if found is None:
        raise failure
    if alike:
        try:
            above, _ = _fine(run, at_resolution(relaxed, _above(found.model)), increment)
            return _with_errors(found, above, steps)
        except ComputationError:
            pass
    return found


def _differ(one, other):
    """Whether two models differ in control and in contact points.

    Yarns pressed close to a core may take more contact points: two models that take as many tell nothing of
    the error that these leave.
    """
    a, b = one.cell, other.cell
    return a.points != b.points and not 1.0 / UNLIKE < a.contacts / b.contacts < UNLIKE


def _above(model):
    """The Resolution a rung above that of a model, with more contact points than it took."""
    contacts = 4 * int(np.ceil(1.5 * model.cell.contacts / 4.0))
    return replace(finer(model.resolution, model.fabric), contacts=contacts)


def _fine(run, start, increment, refine=True):
    """The test, and where it started, with as many contact points as its states need, if ``refine``."""
    start = released(start, rubs=True)
    curve = run(start, increment)
    curve = curve.replaced(increment=increment) if start.model.rub else curve
    most = min(MOST_DENSE * start.model.cell.contacts, MOST_CONTACTS) if refine else 0
    while curve.ended == TOO_CLOSE and start.model.cell.contacts * DENSER <= most:
        contacts = 4 * int(np.ceil(start.model.cell.contacts * DENSER / 4.0))
        start = at_resolution(start, replace(start.model.resolution, contacts=contacts))
        start = released(start, rubs=True)
        curve = run(start, increment)
    return curve, start


def largest_error(curve):
    """The largest estimated error of a result that counts; infinite where one is not known."""
    errors = [counted_error(curve.value, curve.place, curve.segment, curve.numerical_error)]
    if isinstance(curve, BendingCurve):
        errors.append(curve.change_error)
    errors = np.concatenate(errors)
    return float(errors.max()) if np.isfinite(errors).all() and errors.size else np.inf


def _stepped(start, run, increment, curve, accuracy):
    """The test in steps that are short enough, these steps, and the test in steps twice as long."""
    apart = np.abs(np.diff(curve.place)).max(initial=0.0)
    if 0.0 < apart < 1.5 * increment:
        # Steps end at the states: those of twice the increment would be the same.
        twice, increment = curve, 0.5 * apart
        curve = run(start, increment)
    else:
        twice = run(start, 2.0 * increment)
    for _ in range(HALVINGS):
        if np.isinf(accuracy):
            break
        if largest_error(_with_errors(curve, None, (curve, twice))) <= SHARE * accuracy:
            break
        increment /= 2.0
        twice, curve = curve, run(start, increment)
    return curve, increment, (curve, twice)


def _with_errors(curve, coarse, steps):
    """The curve with its errors: by a coarser solution, and by a pair in steps of two lengths."""
    pairs = [] if coarse is None else [(_part(curve.model, coarse.model), curve, coarse)]
    pairs += [] if steps is None else [(STEPPED, *steps)]
    if not pairs:
        return curve
    off = sum(part * _off(a, b, curve) for part, a, b in pairs)
    curve = curve.replaced(numerical_error=off / scale_of(curve.value))
    if not isinstance(curve, BendingCurve):
        return curve
    off = sum(part * _off(a, b, curve, a.flat_moment - b.flat_moment) for part, a, b in pairs)
    # Told against the largest change, so it is the largest of all.
    off = np.where(np.isnan(off), off, np.fmax.reduce(off, initial=0.0))
    largest = np.abs(curve.value - curve.flat_moment).max()
    return curve.replaced(change_error=off / largest if largest > 0.0 else 0.0 * off)


def _off(one, other, curve, shift=0.0):
    """Difference of the values of two solutions at the states of a curve, (steps,).

    The largest around each state on the same way, after the first one as it counts there, and of a test to
    both sides around each at all; NaN where one of them did not come.  shift: by which the values of the one
    are higher throughout.  A balanced pattern that lies flat keeps its own: there it has no moment, and that
    of states beside it is no measure.
    """
    off = np.abs(_at(one, curve) - shift - _at(other, curve))
    if (curve.place < 0.0).any():
        balanced = isinstance(curve, BendingCurve) and curve.model.fabric.pattern.balanced
        flat = (curve.place == 0.0) & (curve.segment == 0)
        return np.where(flat & balanced, off, _neighbourhood(off))
    scale = counted_scale(curve.value, curve.place, curve.segment)
    for segment in np.unique(curve.segment):
        mine = curve.segment == segment
        over = scale[mine] if segment > 0 else 1.0
        off[mine] = _neighbourhood(off[mine] / over) * over
    return off


def _at(one, curve):
    """Values of a solution at the states of another: one by one or, where the way back ends elsewhere, by
    place within segment and phase."""
    if one.steps == curve.steps and np.allclose(one.place, curve.place, rtol=1e-9, atol=1e-9):
        return one.value
    values = np.full(curve.steps, np.nan)
    for segment in np.unique(curve.segment):
        mine = np.flatnonzero(curve.segment == segment)
        theirs = np.flatnonzero(one.segment == segment)
        if not theirs.size:
            continue
        theirs = theirs[np.argsort(one.place[theirs])]
        place, low, high = curve.place[mine], one.place[theirs[0]], one.place[theirs[-1]]
        # A way to a force ends elsewhere by what its strain there is off.
        reached = (place >= low - NEAR) & (place <= high + NEAR)
        at = _onward(place, one.place[theirs], one.value[theirs])
        values[mine] = np.where(reached, at, np.nan)
    return values


def _onward(x, places, values):
    """Values at x, interpolated linearly; beyond the ends on the straight lines that end there."""
    at = np.interp(x, places, values)
    for end, inner in ((0, 1), (-1, -2)) if len(places) > 1 else ():
        beyond = x < places[0] if end == 0 else x > places[-1]
        slope = (values[end] - values[inner]) / (places[end] - places[inner])
        at = np.where(beyond, values[end] + slope * (x - places[end]), at)
    return at


def scale_of(values):
    """What errors of a curve's values are measured against: the size, 1 % of the largest at least."""
    return np.maximum(np.abs(values), SMALLEST_OF_LARGEST * np.abs(values).max(initial=0.0))


def _neighbourhood(values):
    """Largest of the values within AROUND places; NaN where the value itself is."""
    if not values.size:
        return values
    padded = np.pad(values, AROUND, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1)
    return np.where(np.isnan(values), np.nan, np.fmax.reduce(around, axis=1))
