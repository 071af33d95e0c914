"""A measured test of a fabric or a yarn: one type, from the file to the figure."""

import csv
import io
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from scipy.interpolate import PchipInterpolator

from knitsim.errors import InputError
from knitsim.files import replacing
from knitsim.measured.course import turns
from knitsim.units import from_si, label

# Kinds of tests: the quantities of their curve, x before y.
KINDS = {
    "tension": ("strain", "force_per_width"),
    "bending": ("curvature", "moment_per_width"),
    "yarn_tension": ("strain", "force"),
    "yarn_compression": ("thickness", "force"),
}
LOADING, RECOVERY = 0, 1
EVEN, LEAST_PIECES = 0.7, 20  # part of the points that must count alike for a curve to be even
MOST_POINTS = 200  # of a curve that is fitted; of longer ones the means of so many pieces
# Units in which people read the quantities, and in which they are written to a file.
SHOWN = {
    "strain": "percent", "lateral_strain": "percent", "strain_low": "percent", "strain_high": "percent",
    "force_per_width": "N_per_mm", "force": "N", "thickness": "mm", "curvature": "per_cm",
    "moment_per_width": "mN",
}  # fmt: skip
_WRITTEN = SHOWN | {"moment_per_width": "mN_m_per_m"}


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredTest:
    """A measured test in SI; arrays (n,) in the order of the test, read-only.

    kind: tension or bending of a fabric, yarn_tension, yarn_compression (two crossed yarns).  values:
    {quantity: array}, x and y of :data:`KINDS`; of a fabric's tension also lateral_strain (NaN where it
    was not measured) and strain_low, strain_high, the band of the strain, if they were measured; weight
    if it was stated.  direction: course or wale, pulled or becoming curved; "" of a yarn, or if it is not
    stated.  phase: 0 loading, 1 recovery.  name: how messages and results call it.

    strain counts from the state under ``pretension`` (N/m, of a yarn N; 0 without one), of the specimen
    alone; curvature is positive with the technical face convex.  lateral: of a model that follows the
    test, "free", "held" or a force per width across the pull (N/m).  cycle: which one of the test it is,
    from 1.  broke_below: the strain of the first point after the break; inf if the specimen did not
    break, None if nobody looked.

    cycles: every cycle of a test of several.  specimens: each of several, of which this is the mean.
    source: of the file.  conditions: {name: SI value}, such as gauge_length and width (m).
    recognised, corrections, comments: what was recognised in the file, what was done to its numbers and
    what else it says, in words.  left_out: (first line, last line, why) of rows.
    """

    kind: str
    values: Mapping[str, np.ndarray]
    direction: str = ""
    name: str = ""
    phase: np.ndarray | None = None
    pretension: float = 0.0
    lateral: str | float = "free"
    cycle: int = 1
    broke_below: float | None = None
    cycles: tuple = ()
    specimens: tuple = ()
    source: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)
    recognised: tuple[str, ...] = ()
    corrections: tuple[str, ...] = ()
    comments: tuple[str, ...] = ()
    left_out: tuple[tuple, ...] = ()

    def __post_init__(self):
        where = self.name or self.source or "measured test"
        if self.kind not in KINDS:
            raise InputError(f"{where}: kind", self.kind, f"must be {' or '.join(KINDS)}")
        wanted = ("course", "wale", "") if self.kind in ("tension", "bending") else ("",)
        if self.direction not in wanted:
            right = "must be course or wale" if len(wanted) > 1 else "is of a fabric, not of a yarn"
            raise InputError(f"{where}: direction", self.direction, right)
        if not self.cycle >= 1:
            raise InputError(f"{where}: cycle", self.cycle, "must be 1 or more")
        values, size = {}, None
        for quantity, given in self.values.items():
            values[quantity] = _array(f"{where}: {quantity.replace('_', ' ')}", given, size,
                                      may_lack=quantity == "lateral_strain")  # fmt: skip
            size = len(values[quantity])
        for quantity in KINDS[self.kind]:
            if quantity not in values:
                raise InputError(
                    f"{where}: {quantity}", None, f"is missing in a test of {self.kind}"
                )
        low, high = values.get("strain_low"), values.get("strain_high")
        if (low is None) != (high is None):
            raise InputError(f"{where}: band", None, "must have both its low and its high end")
        weight = values.get("weight")
        if weight is not None and ((weight < 0).any() or not weight.any()):
            raise InputError(
                f"{where}: weight", weight.tolist(), "must not be negative, nor all zero"
            )
        phase = np.zeros(size, dtype=int) if self.phase is None else np.array(self.phase, dtype=int)
        if phase.shape != (size,) or not np.isin(phase, (LOADING, RECOVERY)).all():
            raise InputError(
                f"{where}: phase", phase.tolist(), "must be 0 (loading) or 1 (recovery)"
            )
        if self.kind == "tension" and not (phase == LOADING).any():
            raise InputError(f"{where}: phase", "recovery only", "must have loading points")
        phase.setflags(write=False)
        object.__setattr__(self, "values", MappingProxyType(values))
        object.__setattr__(self, "phase", phase)

    def __getitem__(self, quantity):
        return self.values[quantity]

    def __contains__(self, quantity):
        return quantity in self.values

    def __len__(self):
        return len(self.phase)

    def __repr__(self):
        x, y = KINDS[self.kind]
        top = int(np.argmax(np.abs(self[x]))) if self.kind == "bending" else int(np.argmax(self[y]))
        way = {"tension": f" along the {self.direction}", "bending": f" of the {self.direction}"}
        parts = [self.kind.replace("_", " ") + (way[self.kind] if self.direction else "")]
        parts.append(f"{len(self)} points to {_value(x, self[x][top])}, {_value(y, self[y][top])}")
        if (self.phase == RECOVERY).any() and self.kind != "bending":
            parts.append("with recovery")
        parts += [f"{len(self.specimens)} specimens"] if self.specimens else []
        parts += [f"cycle {self.cycle} of {len(self.cycles)}"] if self.cycles else []
        return f"<{type(self).__name__} {self.name or self.source}: {', '.join(parts)}>"

    @property
    def x(self):
        """Strain, curvature or thickness, (n,)."""
        return self[KINDS[self.kind][0]]

    @property
    def y(self):
        """Force, force per width or moment per width, (n,)."""
        return self[KINDS[self.kind][1]]

    @property
    def loading(self):
        """Whether each point is of loading, (n,) bool."""
        return self.phase == LOADING

    @property
    def band(self):
        """(low, high) of the strain, (n,) each, or None without a band of some width."""
        low, high = self.values.get("strain_low"), self.values.get("strain_high")
        return None if low is None or not (low < high).any() else (low, high)

    @property
    def weight(self):
        """Weight of each point in a fit, (n,): as stated, or its share of the curve's length, of mean 1.

        So a curve counts alike however many rows a machine has written of a part of it.
        """
        return self["weight"] if "weight" in self else shares(self.x, self.y, self.phase)

    def kept(self, points, **changes):
        """The test with these points only (bool or numbers)."""
        values = {name: value[points] for name, value in self.values.items()}
        return replace(self, **({"values": values, "phase": self.phase[points]} | changes))

    def counted_from(self, zero, across=None):
        """The test with its strains counted from the state strained by ``zero``, ``across`` it."""
        values = dict(self.values)
        for name in ("strain", "strain_low", "strain_high"):
            if name in values:
                values[name] = from_pretension(values[name], zero)
        if across is not None and "lateral_strain" in values:
            values["lateral_strain"] = from_pretension(values["lateral_strain"], across)
        broke = self.broke_below
        broke = broke if broke is None or np.isinf(broke) else from_pretension(broke, zero)
        return replace(self, values=values, broke_below=broke)

    def to_fit(self):
        """A tension test of a fabric as a fit sees it: the points that say something, 200 at most.

        Loading above the pretension and above no strain, recovery not below zero force nor above the
        largest of loading; of longer curves the means of pieces of equal length.
        """
        strain, force = self.x, self.y
        top = force[self.loading].max()
        keep = np.where(self.loading, (force > self.pretension) & (strain > 0.0), force >= 0.0)
        keep &= force <= top
        if not (keep & self.loading).any():
            raise InputError(
                f"{self.name}: points",
                len(self),
                "none is of loading above the pretension and no strain",
            )
        return self.kept(keep).thinned()

    def thinned(self, most=MOST_POINTS):
        """The test with ``most`` points at most: the means of pieces of its curve of equal length."""
        return self._pieces(shares(self.x, self.y, self.phase), most) if len(self) > most else self

    def evened(self, most):
        """The test with ``most`` points at most, as dense in every part: the means of pieces of equal
        range of x, where rows stand much closer in one part than in another or are more."""
        share = shares(self.x, np.zeros(len(self)), self.phase)
        dense = int(share.sum() ** 2 / (share @ share))  # as many even points carry as much
        if len(self) <= most and dense >= EVEN * len(self):
            return self
        return self._pieces(share, min(most, max(dense, LEAST_PIECES)))

    def _pieces(self, share, count):
        """The test with the means of ``count`` pieces of equal share (n,), and its end of loading."""
        place = (np.cumsum(share) - 0.5 * share) / share.sum()
        piece = 4 * np.minimum((place * count).astype(int), count - 1) + 2 * self.phase
        # The end of loading, which may be the break, stands by itself behind its piece.
        piece[np.flatnonzero(self.loading)[-1]] += 1
        _, piece = np.unique(piece, return_inverse=True)

        def mean(values):
            known = np.isfinite(values)
            total = np.bincount(piece, np.where(known, values, 0.0))
            count = np.bincount(piece, known)
            return np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0)

        values = {name: mean(value) for name, value in self.values.items()}
        return replace(self, values=values, phase=np.round(mean(self.phase)).astype(int))

    def record(self):
        """What a result file keeps of where the numbers come from, as plain JSON types."""
        found = {
            "kind": self.kind, "direction": self.direction, "source": self.source, "points": len(self),
            "conditions": dict(self.conditions), "pretension": self.pretension,
            "recognised": list(self.recognised),
            "corrections": list(self.corrections), "left_out": [list(row) for row in self.left_out],
            "comments": list(self.comments),
        }  # fmt: skip
        if self.specimens:
            found["specimens"] = [test.record() for test in self.specimens]
        return found

    def to_dataframe(self):
        """A pandas.DataFrame of the curve in SI, with phase."""
        import pandas as pd

        phases = np.array(["loading", "recovery"])[self.phase]
        return pd.DataFrame({**self.values, "phase": phases})

    def plot(self, ax=None, **options):
        """Draw it in %, gf/cm and 1/cm; the matplotlib axes (new ones without ``ax``)."""
        from knitsim.measured.drawn import draw

        return draw(self, ax, **options)

    def to_csv(self, path, *, comma=False):
        """Write the curve as a file that :func:`knitsim.measured.read.read_measured` reads.

        comma: semicolons and decimal commas, which Excel opens where the comma is the decimal sign.
        """
        delimiter = ";" if comma else ","
        file = io.StringIO(newline="")
        writer = csv.writer(file, delimiter=delimiter, lineterminator="\r\n" if comma else "\n")
        names = [name for name in self.values if name in _WRITTEN]
        for name, value in self.conditions.items():
            unit = {"gauge_length": "mm", "width": "mm", "linear_density": "dtex"}.get(name)
            if unit:
                file.write(
                    f"# {name}_{unit}: {_text(from_si(value, unit), comma)}{writer.dialect.lineterminator}"
                )
        writer.writerow([f"{name}_{_WRITTEN[name]}" for name in names])
        columns = [from_si(self[name], SHOWN[name]) for name in names]
        for row in zip(*columns, strict=True):
            writer.writerow(["" if np.isnan(value) else _text(value, comma) for value in row])
        with replacing(path) as partial:
            partial.write_text(file.getvalue(), "utf-8-sig" if comma else "utf-8", newline="")


def from_pretension(strain, zero):
    """Strain counted from the state that is strained by ``zero``."""
    return (1.0 + strain) / (1.0 + zero) - 1.0


def loading_at(wanted, force, values):
    """Measured ``values`` (n,) of first loading, read at forces (N/m); NaN outside those measured."""
    force = np.maximum.accumulate(force)
    return np.interp(wanted, force, values, left=np.nan, right=np.nan)


def zero_at(pretension, force, values, own):
    """Measured strain, along or across the pull, under ``pretension`` (N/m).

    force (N/m), values: of first loading, (n,), counted from the state under ``own`` (N/m), above
    which the pretension lies.
    """
    return float(loading_at(pretension, np.append(own, force), np.append(0.0, values)))


def shares(x, y, phase):
    """Share of each point (n,) in the length of its curve, of mean 1.

    The length grows by the part of their range by which x and y pass what they have reached, so that
    noise and rows of a hold add nothing: on loading upwards, on recovery downwards.  A point far out
    counts as the middle one of it and its neighbours.
    """
    length = np.zeros(len(x))
    for way, first in ((1.0, np.maximum.accumulate), (-1.0, np.minimum.accumulate)):
        own = phase == (LOADING if way > 0 else RECOVERY)
        for values in (x, y):
            span, along = np.ptp(values), values[own]
            if span > 0 and own.any():
                middle = np.median([along[:-2], along[1:-1], along[2:]], axis=0)
                along = np.concatenate([along[:1], middle, along[1:][-1:]])
                length[own] += way * (first(along) - along[0]) / span
    share = np.empty(len(x))
    for one in (LOADING, RECOVERY):
        own = phase == one
        if own.any():
            at = length[own]
            padded = np.concatenate([at[:1], at, at[-1:]])
            share[own] = 0.5 * (padded[2:] - padded[:-2])
    total = share.sum()
    return share * (len(x) / total) if total > 0 else np.ones(len(x))


def mean_of(tests, name, source):
    """The mean of several specimens as one :class:`MeasuredTest`, with each of them kept.

    Of a fabric's tension the mean strain at given force and its standard deviation to both sides, as far
    as every specimen goes; else the mean of force or moment.  Raises InputError for tests that differ in
    kind, direction or pretension, or in the passes of a bending test.
    """
    first = tests[0]
    for quantity in ("kind", "direction", "pretension", "cycle"):
        seen = list(dict.fromkeys(getattr(test, quantity) for test in tests))
        if len(seen) > 1:
            raise InputError(f"{name}: {quantity}", seen, "must be the same of all specimens")
    phase = np.zeros(0, dtype=int)
    if first.kind == "tension":
        values, phase = _mean_tension(tests)
    elif first.kind == "bending":
        passes = [_passes(test.x) for test in tests]
        if len({len(one) for one in passes}) > 1:
            raise InputError(
                f"{name}: curvature", [len(p) for p in passes], "must turn alike in all specimens"
            )
        moment = np.mean([
            np.concatenate([
                _read(test.x[run], test.y[run], first.x[at]) for run, at in zip(own, passes[0], strict=True)
            ])
            for test, own in zip(tests, passes, strict=True)
        ], axis=0)  # fmt: skip
        values = {
            "curvature": np.concatenate([first.x[at] for at in passes[0]]),
            "moment_per_width": moment,
        }
    else:
        x, y = KINDS[first.kind]
        low, high = max(test.x.min() for test in tests), min(test.x.max() for test in tests)
        at = max(tests, key=len).evened(MOST_POINTS).x
        at = np.unique(np.clip(at, low, high))
        values = {x: at, y: np.mean([_read(test.x, test.y, at) for test in tests], axis=0)}
    broke = [test.broke_below for test in tests if test.broke_below is not None]
    said = [f"mean of {len(tests)} specimens"]
    if first.kind == "yarn_tension" and broke and np.isfinite(broke).all():
        said.append(
            f"they broke at strains of {', '.join(f'{t.x[-1]:.4g}' for t in tests)}; the least counts"
        )
    return replace(
        first, values=values, phase=phase if phase.size else None, name=name, source=source,
        broke_below=min(broke, default=None), specimens=tuple(tests), cycles=(),
        recognised=tuple(dict.fromkeys([*said, *(s for test in tests for s in test.recognised)])),
        corrections=tuple(f"{test.name}: {s}" for test in tests for s in test.corrections),
        comments=tuple(dict.fromkeys(c for test in tests for c in test.comments)),
        left_out=tuple(dict.fromkeys(row for test in tests for row in test.left_out)),
    )  # fmt: skip


def _mean_tension(tests):
    """(values, phase) of the mean strain at given force of fabrics' tension tests, and its deviation."""
    parts, phases = [], []
    top = min(test.y[test.loading].max() for test in tests)
    lateral = all(np.isfinite(test.values.get("lateral_strain", np.nan)).all() for test in tests)
    for one in (LOADING, RECOVERY):
        own = [test.phase == one for test in tests]
        if not all(points.any() for points in own):
            continue
        curves = list(zip(tests, own, strict=True))
        shortest = min(own, key=np.sum)
        first = next(test for test, points in curves if points is shortest)
        least = max(test.y[points].min() for test, points in curves)
        force = np.unique(np.clip(first.y[shortest], least, top))
        if len(force) > MOST_POINTS:
            force = np.quantile(force, np.linspace(0.0, 1.0, MOST_POINTS))
        force = force if one == LOADING else force[::-1]
        strain = np.array([_read(test.y[points], test.x[points], force) for test, points in curves])
        middle, spread = strain.mean(axis=0), strain.std(axis=0, ddof=1)
        part = {"strain": middle, "force_per_width": force, "strain_low": middle - spread,
                "strain_high": middle + spread}  # fmt: skip
        if lateral:
            across = [
                _read(t.y[points], t["lateral_strain"][points], force) for t, points in curves
            ]
            part["lateral_strain"] = np.mean(across, axis=0)
        parts.append(part)
        phases.append(np.full(len(force), one))
    return {q: np.concatenate([p[q] for p in parts]) for q in parts[0]}, np.concatenate(phases)


def _passes(x):
    ends = [-1, *turns(x)]
    return [np.arange(a + 1, b + 1) for a, b in itertools.pairwise(ends)]


def _read(x, y, at):
    """y (n,) at ``at`` along x that rises or falls but for noise; a smooth curve through few points."""
    if x[-1] < x[0]:
        x, y = x[::-1], y[::-1]
    rising = np.concatenate([[True], x[1:] > np.maximum.accumulate(x)[:-1]])
    x, y = x[rising], y[rising]
    at = np.clip(at, x[0], x[-1])
    return PchipInterpolator(x, y)(at) if 1 < len(x) <= MOST_POINTS else np.interp(at, x, y)


def _array(where, values, size, may_lack=False):
    try:
        values = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(where, values, "must be numbers") from None
    if values.ndim != 1 or len(values) < 1 or not (np.isfinite(values).all() or may_lack):
        raise InputError(where, values.tolist(), "must be 1 or more finite numbers")
    if size is not None and len(values) != size:
        raise InputError(where, len(values), f"must be {size} numbers, one for each point")
    values.setflags(write=False)
    return values


def _value(quantity, value):
    """A value with the unit in which people read it."""
    unit = SHOWN[quantity]
    shown = label(unit) if unit != "percent" else "%"
    return f"{from_si(value, unit):.3g} {shown}"


def _text(value, comma):
    text = f"{value:.9g}"
    return text.replace(".", ",") if comma else text
