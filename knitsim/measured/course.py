"""What happens in the course of a measured test: loading between noise, holds, cycles, the break, the
zero of the load cell, slack.

One rule holds for yarns and fabrics.  x is strain or curvature, y force or moment, (n,) in the order of
the test; what is found are numbers of points.
"""

import itertools
from dataclasses import dataclass, field

import numpy as np

# Why rows are left out.
HOLD, AFTER_BREAK = "a hold, at which x stands still", "after the break"
LEAST_LOADING = 4  # points of loading for a curve
NOISE = 0.03  # part of the range of x, or of the largest y, by which noise may go back
CYCLE = 0.1  # part of the range of x by which a cycle of a tension goes back at least
TURN = 0.05  # part of the whole range by which a test goes back where it turns; less is a fault
ZERO = 0.005  # part of the largest force up to which a force at no strain is none
UNSEEN = 0.01  # the same, where the file begins later and the force at no strain is extrapolated
AT_ONCE = 0.005  # part of the range of x within which a test begins
_DROP = 0.9  # part of the largest force below which a record that ends has seen the break
_FLAT = 1e-3  # part of the range within which x stands still
_LOW = (0.002, 0.005, 0.01, 0.02)  # parts of the largest force up to which slack is looked for
_CERTAIN = 16.0  # gain in squares over the variance from which slack is certain, four deviations


def turns(x, part=TURN):
    """Numbers of the last point of each pass of a whole test, the last point of all included.

    x: (n,).  A pass ends at the extreme from which x then goes back by ``part`` of its range; of equal
    extremes at the first.
    """
    x = [float(value) for value in x]
    least = part * (max(x) - min(x))
    ends, way, low, high = [], 0, 0, 0
    for i, value in enumerate(x):
        # low and high: extremes since the last turn, the later of which ends the pass.
        if value > x[high]:
            high = i
        if value < x[low]:
            low = i
        if way >= 0 and x[high] - value >= least and x[high] > value:
            if way > 0:
                ends.append(high)
            way, low, high = -1, i, i
        elif way <= 0 and value - x[low] >= least and value > x[low]:
            if way < 0:
                ends.append(low)
            way, low, high = 1, i, i
    return [*ends, len(x) - 1]


def holds(x, y):
    """Whether each point (n,) is of a hold, at which x stands still for longer than it takes to pass.

    Of a hold that point is kept with which it begins, of one before the test that with which it ends.
    """
    held = np.zeros(len(x), dtype=bool)
    span, rise = np.ptp(x), np.ptp(y)
    if len(x) <= LEAST_LOADING or not span > 0:
        return held
    tolerance = span * min(max(_FLAT, 4.0 * noise(np.arange(len(x)), x) / span), 0.01)
    bins = np.floor((x - x.min()) / (2.0 * tolerance)).astype(int)
    counts = np.bincount(bins)
    most = 1.5 * float(np.median(counts[counts > 0])) + 2.5
    values, first = x.tolist(), 0
    while first < len(x):
        end = first + 1
        while end < len(x) and abs(values[end] - values[first]) <= tolerance:
            end += 1
        own, quarter = y[first:end], max(1, (end - first) // 4)
        if end - first > most and own[-quarter:].mean() - own[:quarter].mean() <= ZERO * rise:
            if first == 0:
                held[: end - 1] = True
            else:
                held[first + 1 + int(np.argmax(own)) : end] = True
        first = end
    return held


@dataclass(eq=False)
class Cycle:
    """Numbers of the points of one cycle: loading, and recovery after it; broke: whether loading ends
    with a break."""

    loading: np.ndarray
    recovery: np.ndarray = field(default_factory=lambda: np.arange(0))
    broke: bool = False

    @property
    def points(self):
        return np.concatenate([self.loading, self.recovery])


@dataclass(eq=False)
class Course:
    """cycles: list of :class:`Cycle`; left_out: [(points, why)]; tail: points after the break."""

    cycles: list
    left_out: list
    tail: np.ndarray


def course_of(columns, x, y):
    """The :class:`Course` of a test that is pulled and let go, or pulled until it breaks.

    columns: knitsim.measured.columns.Columns, which names points in messages.  Raises InputError for
    points that are not in the order of such a test.
    """
    left_out, cycles, tail = [], [], np.arange(0)
    edges = [0, *(row for row, _ in columns.breaks), len(x)]
    for first, end in itertools.pairwise(edges):
        rows = np.arange(first, end)
        held = holds(x[rows], y[rows])
        if held.any():
            left_out.append((rows[held], HOLD))
        rows = rows[~held]
        for rising, run in _runs(columns, x, rows):
            if rising:
                # A point at which the test turns belongs to both ways.
                turned = (
                    cycles[-1].recovery[-1:]
                    if cycles and cycles[-1].loading[0] >= first
                    else run[:0]
                )
                cycles.append(Cycle(np.concatenate([turned, run])))
            else:
                cycles[-1].recovery = run
    for number, cycle in enumerate(cycles):
        if len(cycle.loading) < 3:
            continue
        last, broke = last_before_break(x[cycle.loading], y[cycle.loading])
        if broke:
            behind = [one for c in cycles[number + 1 :] for one in (c.loading, c.recovery)]
            tail = cycle.loading[last + 1 :]
            left_out.append((np.concatenate([tail, cycle.recovery, *behind]), AFTER_BREAK))
            cycle.loading, cycle.recovery, cycle.broke = (
                cycle.loading[: last + 1],
                np.arange(0),
                True,
            )
            del cycles[number + 1 :]
            break
    while (
        len(cycles) > 1 and len(cycles[-1].loading) < LEAST_LOADING and not cycles[-1].recovery.size
    ):
        left_out.append((cycles.pop().loading, "the beginning of another cycle"))
    return Course(cycles, left_out, tail)


def _runs(columns, x, rows):
    """(whether it rises, points) of each pass of the points ``rows``."""
    ends = turns(x[rows], CYCLE)
    runs, first = [], 0
    for end in ends:
        run = rows[first : end + 1]
        rising = bool(x[run[-1]] > x[rows[max(first - 1, 0)]]) or end == 0
        if runs and len(runs[-1][1]) == 1 and rising and not runs[-1][0]:
            # One point back and up again: the next cycle without a way back.
            run = np.concatenate([runs.pop()[1], run])
        runs.append((rising, run))
        first = end + 1
    if not runs[0][0] or (len(runs) > 1 and len(runs[0][1]) < LEAST_LOADING):
        top = int(runs[0][1][-1]) if runs[0][0] else 0
        raise columns.refused(
            _x(columns), top,
            f"is the largest strain after {len(runs[0][1]) if top else 1} points of loading; at least "
            f"{LEAST_LOADING} are needed (loading comes first, then recovery)",
        )  # fmt: skip
    for number, (rising, run) in enumerate(runs[1:], start=1):
        if rising and len(run) < LEAST_LOADING and number < len(runs) - 1:
            raise disorder(
                columns, _x(columns), int(runs[number - 1][1][0]), "strain", "falls on loading"
            )
    _refuse_apart(columns, x, runs)
    return runs


def _refuse_apart(columns, x, runs):
    """InputError for a row or two at the end that are far from all others, as a mean below the data is."""
    (_, before), (rising, last) = (None, [0]) if len(runs) < 2 else runs[-2], runs[-1]
    if rising or len(last) > 2:
        return
    point = int(last[0])
    if x[before[-1]] - x[point] > 3.0 * np.diff(x[before]).max():
        raise columns.refused(
            _x(columns), point,
            "stands apart from the rows before it: if it is a mean below the data, state skip: "
            f"[{columns.lines[point]}]; a recovery has 3 rows or more",
        )  # fmt: skip


def _x(columns):
    return "strain" if "strain" in columns.values else "curvature"


def disorder(columns, quantity, point, what, way):
    return columns.refused(
        quantity, point,
        f"{what} {way}: points must be in the order of the test, loading then recovery, of one cycle or "
        "of several",
    )  # fmt: skip


def refuse_disorder(columns, course, x, y):
    """Strain must rise on loading and fall on recovery but for noise, and so must a fabric's force."""
    quantities = [("strain", x, "strain")]
    if "force_per_width" in columns.values:
        quantities.append(("force_per_width", y, "force"))
    for cycle, (name, values, what) in itertools.product(course.cycles, quantities):
        span = np.ptp(values[cycle.points])
        recovery = values[np.concatenate([cycle.loading[-1:], cycle.recovery])]
        # The fall below what was reached before; on recovery the rise above.
        back = np.concatenate([
            np.maximum.accumulate(values[cycle.loading]) - values[cycle.loading],
            (recovery - np.minimum.accumulate(recovery))[1:],
        ])  # fmt: skip
        bad = back > NOISE * span
        if bad.any():
            first = int(np.argmax(bad))
            way = "falls on loading" if first < len(cycle.loading) else "rises on recovery"
            raise disorder(columns, name, int(cycle.points[first]), what, way)


def reading_at_start(x, y, loading):
    """(force at no strain, whether the file begins there, its uncertainty) of first loading.

    Where it begins later, a line and a parabola through the first third of the loading are read at no
    strain; their mean counts, and half of what lies between them is uncertain.
    """
    own, force = x[loading], y[loading]
    span, largest = np.ptp(own), float(force.max())
    scatter = noise(own, force) if len(own) > 2 else 0.0
    if own[0] <= AT_ONCE * max(span, own.max()):
        first = own <= max(own[0], 0.0) + AT_ONCE * span
        count = int(first.sum())
        if count > 2:
            found = float(force[first].mean())
        else:
            low, high = np.sort(own[:2])
            found = float(np.interp(0.0, [low, high], force[np.argsort(own[:2])]))
        return found, True, max(ZERO * largest, 4.0 * scatter / np.sqrt(max(1, count - 2)))
    first = own <= own[0] + span / 3.0
    first[:4] = True
    line, parabola = (np.polyfit(own[first], force[first], degree)[-1] for degree in (1, 2))
    return (
        float(0.5 * (line + parabola)), False, float(UNSEEN * largest + 0.5 * abs(line - parabola)),
    )  # fmt: skip


def reading_of_tail(y, tail, largest):
    """Force after the break, (value, whether it is steady); (nan, False) for a short tail."""
    if len(tail) < 6:
        return np.nan, False
    late = y[tail[len(tail) // 2 :]]
    value = float(np.median(late))
    return value, bool(np.median(np.abs(late - value)) <= ZERO * largest)


def slack_of(x, y, loading):
    """Strain up to which the specimen hangs slack, by the first points of loading; 0 without slack.

    a max(x - x0, 0)^p, p from 1 to 3, is fitted to the points of low force: a fabric is soft at first, which
    a power describes, so that slack is certain only where no power from the first point on does, and where
    the force does not rise before x0.
    """
    e, f = x[loading], y[loading]
    for part in _LOW:
        low = f <= part * f.max()
        count = len(f) if low.all() else int(np.argmin(low))
        if count < 2 * LEAST_LOADING:
            continue
        every = -(-count // 400)
        found = _onset(e[:count:every], f[:count:every])
        if found - e[0] >= 2.0 * AT_ONCE * np.ptp(e):
            return found
    return 0.0


def _onset(e, f):
    """x0 of :func:`slack_of` where it is certain, else the first strain."""
    step, starts = (e[-1] - e[0]) / 80.0, np.linspace(e[0], e[-1], 81)[:-4]
    squares = np.array([_squares(e, f, start) for start in starts])
    at_first, onset = squares[0], float(starts[np.argmin(squares)])
    near = onset + step * np.linspace(-1.0, 1.0, 41)[int(onset == e[0]) * 20 :]
    squares = np.array([_squares(e, f, start) for start in near])
    best, onset = float(squares.min()), float(near[np.argmin(squares)])
    flat = f[e < onset]
    if len(flat) < LEAST_LOADING:
        return float(e[0])
    # What is written in coarse steps scatters by them.
    levels = np.unique(f)
    step = float(np.diff(levels).min()) if len(levels) > 1 else 0.0
    variance = max(float(flat.var()), step**2 / 12.0, best / max(1, len(e) - 3))
    half = len(flat) // 2
    rise = float(flat[half:].mean() - flat[:half].mean())
    # A smooth rise is none of scatter, however small.
    smooth = flat.var() > step**2 and noise(e[e < onset], flat) < 0.3 * flat.std()
    rises = rise > 3.0 * np.sqrt(variance * (1.0 / half + 1.0 / (len(flat) - half)))
    certain = at_first - best > _CERTAIN * variance and not rises and not smooth
    return onset if certain else float(e[0])


def _squares(e, f, start):
    """Least sum of squares of a max(e - start, 0)^p over p from 1 to 3."""
    shapes = np.maximum(e - start, 0.0) ** np.linspace(1.0, 3.0, 21)[:, None]
    slopes = np.maximum(shapes @ f, 0.0) / np.maximum((shapes**2).sum(axis=1), 1e-300)
    return float(((f - slopes[:, None] * shapes) ** 2).sum(axis=1).min())


def moment_when_flat(curvature, moment):
    """Moment at no curvature (N), the mean of both ways through it; nan where a test does not pass it."""
    found = {}
    first = 0
    for end in turns(curvature, NOISE):
        own = slice(first, end + 1)
        at, first = curvature[own], end
        if len(at) > 1 and at.min() <= 0.0 <= at.max():
            way = 1 if at[-1] > at[0] else -1
            found.setdefault(way, []).append(float(np.interp(0.0, way * at, moment[own])))
    return float(np.mean([np.mean(values) for values in found.values()])) if found else np.nan


def bending_cycles(columns, curvature, moment):
    """[points] of each cycle of a bending test: to one side, to the other and back, or a part of that.

    Raises InputError for curvatures that are not in the order of such a test.
    """
    edges = [0, *(row for row, _ in columns.breaks), len(curvature)]
    found = []
    for first, end in itertools.pairwise(edges):
        rows = np.arange(first, end)
        held = holds(curvature[rows], np.zeros(len(rows)))
        rows = rows[~held]
        ends = turns(curvature[rows], NOISE)
        begin = 0
        # Two turns make a cycle, which ends where the test passes the flat fabric again.
        for turn in range(1, len(ends) - 1, 2):
            back = rows[ends[turn] + 1 : ends[turn + 1] + 1]
            way = np.sign(curvature[rows[ends[turn]]])
            beyond = np.flatnonzero(way * curvature[back] <= 0.0)
            cut = ends[turn] + 1 + int(beyond[0]) if beyond.size else len(rows)
            if len(rows) - cut - 1 >= LEAST_LOADING:
                found.append(rows[begin : cut + 1])
                begin = cut
        found.append(rows[begin:])
    return found


def noise(strain, values):
    """Standard deviation of the scatter of ``values`` (n,) about a smooth curve over strain (n,).

    From the deviation of each point from the chord of its neighbours, by the median, so that kinks
    and drops do not count.
    """
    left, right = strain[1:-1] - strain[:-2], strain[2:] - strain[1:-1]
    width = left + right
    weight = np.where(width > 0, right / np.where(width > 0, width, 1.0), 0.5)
    chord = weight * values[:-2] + (1 - weight) * values[2:]
    scaled = (values[1:-1] - chord) / np.sqrt(1 + weight**2 + (1 - weight) ** 2)
    return 1.4826 * float(np.median(np.abs(scaled)))


def last_before_break(strain, force):
    """(index of the last point before the break, whether the record shows a break).

    The break is a drop by a tenth of the largest force, and by six times the noise, from which the
    force does not come back; points already falling on the way down are not counted as whole yarn.
    strain, force: (n,), n >= 3, rising strain.
    """
    scatter, largest = noise(strain, force), force.max()
    level = largest - max((1 - _DROP) * largest, 6 * scatter)
    last = int(np.flatnonzero(force >= level)[-1])
    if last == force.size - 1:
        return last, False
    top = int(np.argmax(force))
    while last > top and force[last] < force[last - 1] - 4 * scatter:
        last -= 1
    return last, True
