"""KES tensile parameters LT, WT, RT, EMT of any curve of force per width against strain."""

import numpy as np

from knitsim.errors import InputError
from knitsim.errors import number as checked_number
from knitsim.kes.result import NO_RECOVERY, Collector, LeftOut, shown
from knitsim.kes.single_pass import Pass, checked, in_cycle, place, refuse_turns, runs_of
from knitsim.units import from_si, to_si

STANDARD_FORCE = to_si(500.0, "gf_per_cm")
KNIT_FORCE = to_si(50.0, "gf_per_cm")
NAMES = ("strain", "force_per_width")
RECOVERY_NAMES = ("recovery strain", "recovery force_per_width")
# Parts of the largest force: one that near counts as reached (solvers stop at a force to within a
# tolerance), and one that far above it recovery may begin.
NEAR = 2e-4  # with friction a solved test finds a force to half of this
PAST = 1e-2
_GAP = 2.0  # largest distance to the point at which a pass begins, in its largest step


def tension(
    strain,
    force_per_width,
    *,
    recovery=None,
    phase=None,
    cycle=None,
    number=1,
    start=None,
    max_force=STANDARD_FORCE,
    rule="auto",
    source="",
):
    """KES tensile parameters of a test: an Evaluation.

    strain (1, from the starting length), force_per_width (N/m): (n,) in the order of the test.
    Where recovery begins is seen from the strain, unless ``phase`` (n,) says it (``loading`` and
    ``recovery``, or False and True), or ``recovery``, a pair (strain, force_per_width), stands
    apart.  number: which loading of the test is taken, or, with cycle (n,), which cycle.  A pass
    begins with the last point of the one before; start: (strain, force) at which the test begins,
    such as (0, 0), where the curve does not hold it itself.
    max_force: F_m (N/m), 500 gf/cm; KNIT_FORCE is 50 gf/cm.  rule: how the curve is read between
    its points (:mod:`knitsim.kes.single_pass`).  source: of the curve, for messages.

    The parameters are those of :func:`tension_of`.  Raises InputError for values that are not
    finite or a strain that turns within loading or recovery.
    """
    x, y = checked(strain, force_per_width, NAMES, source)
    if recovery is None:
        up, down, before = _branches(x, y, phase, cycle, number, source)
        back, names = (x[down], y[down]), NAMES
    else:
        if phase is not None or cycle is not None:
            raise InputError(place(source, "recovery"), "given", "needs no phase and no cycle")
        up, before = np.arange(x.size), None
        back, names = checked(*recovery, RECOVERY_NAMES, source), RECOVERY_NAMES
        rising = bool(back[0][-1] > back[0][0])
        refuse_turns(back[0], np.arange(back[0].size), rising, names, source)
        if rising:
            back = tuple(column[::-1] for column in back)
    refuse_turns(x[up], up, True, NAMES, source)
    points = _begun(x[up], y[up], before)
    if start is not None:
        if len(start) != 2 or not start[0] <= x[up[0]]:
            right = f"must be a strain, not above the first, {x[up[0]]:.9g}, and a force per width"
            raise InputError(place(source, "start"), start, right)
        points = _prepended(start, points)
    loading = Pass(*points, names=NAMES, source=source, rule=rule)
    lacking = NO_RECOVERY
    if back[0].size == 1:
        lacking = "recovery has a single point; it needs two, of more states"
    if back[0].size > 1:
        points = _begun(*back, (x[up[-1]], y[up[-1]]))
        back = Pass(*points, names=names, source=source, rule=rule)
    else:
        back = None
    return tension_of(loading, back, max_force=max_force, lacking=lacking)


def tension_of(
    loading, recovery=None, *, max_force=STANDARD_FORCE, lacking=NO_RECOVERY
):  # fmt: skip
    """KES tensile parameters of two passes (:class:`knitsim.kes.single_pass.Pass`).

    After S. Kawabata, The Standardization and Analysis of Hand Evaluation, 2nd ed., 1980; F_m is
    max_force (N/m), and EMT (1; %) the strain at which loading first reaches it.
    WT (J m-2; gf cm/cm2): work of loading, the integral of F from zero strain to EMT; a loading that
    begins later than zero strain must begin at zero force.  LT (1) = WT/(F_m EMT/2).
    RT (1; %): work of recovery, from F_m to zero force, over WT.  Also: WT_recovered (J m-2) and
    residual_strain (1; %), at which recovery comes to zero force.  These three are of a recovery that
    begins at F_m: at most 1 % above, and then counts from where it passes F_m; from another force
    there are none, nor without a recovery, of which ``lacking`` says why.  A force within NEAR F_m of
    F_m, or of zero, counts as reached.
    """
    force = checked_number("max_force", max_force, 0.0)
    if not loading.rising:
        raise InputError("loading", f"from {loading.start:.9g} down", "must go to higher strains")
    found = Collector()
    at = shown(force, "force")

    def extension():
        reached = loading.reach(force, NEAR * force)
        if reached is None:
            most = shown(float(loading.y.max()), "force")
            raise LeftOut(f"loading comes to {most} at most, not to {at}")
        if not reached[0] > 0.0:
            raise LeftOut(f"the force is {at} already at strain {reached[0]:.6g}")
        return reached

    def work():
        [(top, error)] = found.needed("EMT")
        if loading.low > 0.0 and abs(loading.y[0]) > NEAR * force:
            raise LeftOut(
                f"loading begins at strain {loading.low:.6g} with"
                f" {shown(float(loading.y[0]), 'force')}; the work up to there is not known"
            )
        area, area_error = loading.integral(max(loading.low, 0.0), top)
        return area, area_error + force * error

    def linearity():
        (top, top_error), (area, area_error) = found.needed("EMT", "WT")
        linear = 0.5 * force * top
        return area / linear, (area_error + area / top * top_error) / linear

    found.add("EMT", "strain", extension, f"strain at which loading reaches F_m = {at}")
    found.add("WT", "work", work, f"work of loading up to F_m = {at}")
    found.add("LT", "ratio", linearity, f"WT/(F_m EMT/2), F_m = {at}")
    _add_recovery(found, loading, recovery, force, at, lacking)
    read = [f"loading: {loading}"]
    read += [] if recovery is None else [f"recovery: {recovery}"]
    return found.result(read, f"{from_si(force, 'gf_per_cm'):.3g} gf/cm")


def _add_recovery(found, loading, recovery, force, at, lacking):
    def residual():
        [(top, _)] = found.needed("EMT")
        if recovery is None:
            raise LeftOut(lacking)
        most = max(float(loading.y.max()), float(recovery.y.max()))
        if most > (1.0 + PAST) * force:
            raise LeftOut(
                f"recovery begins after {shown(most, 'force')}, not at {at}: pull to that force"
            )
        if not recovery.covers(top, top):
            raise LeftOut(
                f"recovery begins at strain {recovery.high:.6g}, below that of {at}, {top:.6g}"
            )
        zero = recovery.last_zero()
        if zero is None and abs(recovery.y[0]) <= NEAR * force:
            zero = recovery.low, 0.0
        if zero is None:
            least = shown(float(recovery.y[0]), "force")
            raise LeftOut(f"recovery ends at {least}, strain {recovery.low:.6g}, not at zero force")
        return zero

    def recovered():
        [(zero, _)] = found.needed("residual_strain")
        begin = recovery.reach(force) or (recovery.high, 0.0)
        area, area_error = recovery.integral(zero, begin[0])
        # The force vanishes at the lower end: an error of that counts in second order only.
        return area, area_error + force * begin[1]

    def resilience():
        (area, area_error), (back, back_error) = found.needed("WT", "WT_recovered")
        return back / area, (back_error + back / area * area_error) / area

    left = f"strain at which recovery from F_m = {at} comes to zero force"
    found.add("residual_strain", "strain", residual, left)
    found.add("WT_recovered", "work", recovered, f"work of recovery from F_m = {at} to zero force")
    found.add("RT", "share", resilience, f"WT_recovered/WT, F_m = {at}")


def _branches(x, y, phase, cycle, wanted, source):
    """Indices of the points of loading and of recovery, and the point before loading or None."""
    index = in_cycle(cycle, wanted, x.size, source)
    if phase is None:
        runs = runs_of(x, index, NAMES, source)
        loads = [bool(x[run[-1]] > x[run[0]]) for run in runs]
    else:
        back = _is_recovery(phase, x.size, source)[index]
        runs = np.split(index, np.flatnonzero(np.diff(back)) + 1)
        loads = [not back_of for back_of in back[np.searchsorted(index, [r[0] for r in runs])]]
        for run, load in zip(runs, loads, strict=True):
            refuse_turns(x[run], run, load, NAMES, source)
    loadings = [k for k, load in enumerate(loads) if load]
    chosen = wanted if cycle is None else 1
    if not 1 <= chosen <= len(loadings):
        right = f"must be a loading of the test, which has {len(loadings)}"
        raise InputError(place(source, "number"), wanted, right)
    k = loadings[chosen - 1]
    down = runs[k + 1] if k + 1 < len(runs) and not loads[k + 1] else index[:0]
    first = runs[k][0]
    return runs[k], down, (x[first - 1], y[first - 1]) if first else None


def _is_recovery(phase, size, source):
    phase = np.asarray(phase)
    if phase.shape != (size,):
        raise InputError(place(source, "phase"), phase.shape, f"must have shape ({size},)")
    known = (("loading", "recovery"), (0, 1))
    for load, back in known:
        if np.isin(phase, (load, back)).all():
            return phase == back
    right = "must be loading or recovery (or 0, 1) at every point"
    raise InputError(place(source, "phase"), np.unique(phase)[:4].tolist(), right)


def _begun(x, y, before):
    """The points of a pass, with the point ``before`` where it continues from it."""
    if before is None or x.size < 2:
        return [x, y]
    rising = x[-1] > x[0]
    gap = x[0] - before[0] if rising else before[0] - x[0]
    if not 0.0 < gap <= _GAP * np.abs(np.diff(x)).max():
        return [x, y]
    return _prepended(before, (x, y))


def _prepended(point, columns):
    return [np.concatenate([[first], rest]) for first, rest in zip(point, columns, strict=True)]
