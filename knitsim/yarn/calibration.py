"""Tension law of a yarn from its measured tensile curve, with intervals and a judgement of the fit.

Two kinds of law, each of two straight lines from zero:

- ``bilinear``: k1, from the yield strain on k2 <= k1; plastic.  The paper's polyester.
- ``two_slope``: k_low, from the switch strain on k_high >= k_low; reversible.  The paper's cotton
  law k3 with its jump closed: tension = k_high strain - offset above the switch.

Slack, pretension and the toe are found with the constants and taken out of them: see
:mod:`knitsim.yarn.piecewise_fit`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from knitsim.errors import InputError
from knitsim.measured.course import AFTER_BREAK, last_before_break, noise
from knitsim.yarn import law, piecewise_fit

# Names of first slope, second slope and kink, and whether the second line is the flatter one.
KINDS = {
    "bilinear": ("k1", "k2", "yield_strain", True),
    "two_slope": ("k_low", "k_high", "switch_strain", False),
}
LEAST_POINTS = 8
MOST_POINTS = 2000  # of a measured curve; of longer ones the means of so many pieces
# Largest systematic deviation, as a part of the largest force, that a verdict allows.
GOOD, FAIR = 0.01, 0.02
# Noise (rms, part of the largest force) above which no fit is called good.
NOISY = 0.05
# A fit whose information criterion is higher than the best by this is ruled out (odds of 20 to 1).
RULED_OUT = 6.0

_AT_BOUND = "no interval: at a bound of the fit or not determined by the curve"
_NOT_NEEDED = "no interval: 0, as the curve needs none"


@dataclass(frozen=True)
class Estimate:
    """A constant with its 95 % confidence interval; low and high are nan, with a note, if none."""

    value: float
    low: float
    high: float
    unit: str
    note: str = ""

    def __str__(self):
        interval = self.note if self.note else f"{self.low:.5g} to {self.high:.5g}"
        return f"{self.value:.6g} {self.unit} ({interval})".replace(" 1 (", " (")


@dataclass(frozen=True, eq=False)
class Calibration:
    """What :func:`calibrate` found.  All strains but ``slack`` are of the yarn without its slack.

    law: TensionLaw of the curve's whole yarn.  estimates: name -> Estimate, the constants of the
    kind, ``slack`` (recorded strain at which the first line meets zero; below 0: pretension),
    ``toe_half_width``, and for two_slope ``offset``.  onset: the simplest of piecewise_fit.ONSETS
    that the data need.  breaking_strain: of the last point before the break;
    breaking_strain_below: of the first point after it, or inf with break_seen False if the record
    ends before the yarn breaks (breaking_strain is then a lower bound).  rms_deviation,
    max_deviation and systematic_deviation are parts of the largest force; the last is what remains
    when the noise is averaged out.  verdict: good, fair or poor; statement: why.  strain, force,
    fitted: the points used, (n,).  record: of a measured test, what was recognised in its file.
    """

    kind: str
    source: str
    law: law.TensionLaw
    estimates: Mapping[str, Estimate]
    onset: str
    breaking_strain: float
    breaking_strain_below: float
    break_seen: bool
    points_cut: int
    rms_deviation: float
    max_deviation: float
    max_deviation_strain: float
    systematic_deviation: float
    r_squared: float
    verdict: str
    statement: str
    strain: np.ndarray
    force: np.ndarray
    fitted: np.ndarray
    record: Mapping | None = None

    @property
    def paper_form(self):
        """Keyword arguments of knitsim.yarn.law.secant (N): the paper's k3; None if bilinear."""
        if self.kind != "two_slope":
            return None
        names = {
            "low": "k_low",
            "high": "k_high",
            "offset": "offset",
            "switch_strain": "switch_strain",
        }
        return {name: self.estimates[key].value for name, key in names.items()}


def calibrate_test(test, kind, *, onset="auto"):
    """:func:`calibrate` on a measured yarn tension, a knitsim.measured.test.MeasuredTest.

    Rows that stand closer in one part of the curve than in another count as the length of that part.
    """
    points = test.evened(MOST_POINTS)
    found = calibrate(
        points["strain"], points["force"], kind, source=test.source, onset=onset,
        broke_below=test.broke_below,
    )  # fmt: skip
    cut = [last - first + 1 for first, last, why in test.left_out if why == AFTER_BREAK]
    return replace(found, points_cut=sum(cut), record=test.record())


def calibrate(strain, force, kind, *, source="curve", onset="auto", broke_below=None):
    """Fit ``kind`` (a key of KINDS) to a recorded curve by least squares; a Calibration.

    strain, force (N): (n,), n >= 8, strain never falling.  Points from the break on are left out;
    broke_below: the strain of the first of them, inf without a break, where that is known already.
    onset: a key of piecewise_fit.ONSETS, or "auto" for the one that the data need.  Intervals are
    the t quantile times the standard error from the Jacobian, for independent errors of one size;
    with "auto" they cover the intervals of every onset that the data do not rule out.

    Raises InputError if the curve is unfit for any law or shows no change of slope of this kind.
    """
    strain, force = _checked(strain, force, kind, source, onset)
    if broke_below is None:
        last, break_seen = last_before_break(strain, force)
        broke_below = float(strain[last + 1]) if break_seen else np.inf
    else:
        last, break_seen = strain.size - 1, bool(np.isfinite(broke_below))
    e, f = strain[: last + 1], force[: last + 1]
    if e.size < LEAST_POINTS:
        raise InputError(
            source,
            f"{e.size} points before the break",
            f"at least {LEAST_POINTS} are needed",
        )
    if not e[-1] > e[0]:
        raise InputError(source, f"one strain {e[0]:g}", "the strain must rise before the break")
    onsets = tuple(piecewise_fit.ONSETS) if onset == "auto" else (onset,)
    fits = piecewise_fit.fits(e, f, KINDS[kind][3], onsets)
    plausible = _plausible(fits)
    if not plausible:
        _refuse(e, f, kind, source)
    found = plausible[0]
    estimates = _estimates(plausible, kind)
    if kind == "two_slope" and estimates["k_low"].value <= 1e-4 * estimates["k_high"].value:
        raise InputError(
            source, "k_low = 0 N", "no force up to the change of slope: that is slack, not a law"
        )
    slack = estimates["slack"].value
    own = (strain - slack) / (1 + slack)
    breaking = float(own[last])
    deviations, systematic_at = _deviations(own[: last + 1], f, found.fitted)
    verdict = _verdict(deviations)
    notes = _notes(fits, found, deviations["systematic_deviation"], systematic_at, breaking)
    if verdict != "good" and _other_kind(e, f, kind, found.criterion - RULED_OUT):
        notes.append(f"kind {_other(kind)} describes the curve better")
    arrays = {"strain": own[: last + 1].copy(), "force": f.copy(), "fitted": found.fitted}
    for array in arrays.values():
        array.setflags(write=False)
    return Calibration(
        kind=kind,
        source=source,
        law=_law(kind, estimates, breaking),
        estimates=MappingProxyType(estimates),
        onset=found.onset,
        breaking_strain=breaking,
        breaking_strain_below=float((broke_below - slack) / (1 + slack)),
        break_seen=break_seen,
        points_cut=int(strain.size - e.size),
        verdict=verdict,
        statement=_statement(verdict, deviations, found.onset, breaking, break_seen, notes),
        **deviations,
        **arrays,
    )


def _law(kind, estimates, breaking):
    values = {name: estimate.value for name, estimate in estimates.items()}
    if kind == "bilinear":
        return law.bilinear(values["k1"], values["k2"], values["yield_strain"], breaking)
    slopes = values["k_low"], values["k_high"], values["offset"]
    return law.secant(*slopes, values["switch_strain"], breaking, continuous=True)


def _deviations(strain, force, fitted):
    """The figures of merit that a Calibration carries, and the strain of the systematic one."""
    deviation = (force - fitted) / force.max()
    worst = int(np.argmax(np.abs(deviation)))
    systematic, at = _systematic(strain, deviation)
    scatter = np.sum((force - force.mean()) ** 2)
    return {
        "rms_deviation": float(np.sqrt(np.mean(deviation**2))),
        "max_deviation": float(abs(deviation[worst])),
        "max_deviation_strain": float(strain[worst]),
        "systematic_deviation": systematic,
        "r_squared": float(1 - np.sum((force - fitted) ** 2) / scatter),
    }, at


def _verdict(deviations):
    systematic, rms = deviations["systematic_deviation"], deviations["rms_deviation"]
    if systematic <= GOOD and rms <= NOISY:
        return "good"
    return "fair" if systematic <= FAIR else "poor"


def _checked(strain, force, kind, source, onset):
    if kind not in KINDS:
        raise InputError(f"{source}: kind", kind, f"must be {' or '.join(KINDS)}")
    if onset != "auto" and onset not in piecewise_fit.ONSETS:
        right = " or ".join(("auto", *piecewise_fit.ONSETS))
        raise InputError(f"{source}: onset", onset, f"must be {right}")
    strain, force = np.asarray(strain, dtype=float), np.asarray(force, dtype=float)
    if strain.ndim != 1 or strain.shape != force.shape:
        raise InputError(
            source, f"{strain.size} strains and {force.size} forces", "must be one to one"
        )
    if strain.size < LEAST_POINTS:
        raise InputError(source, f"{strain.size} points", f"at least {LEAST_POINTS} are needed")
    if not (np.isfinite(strain).all() and np.isfinite(force).all()):
        raise InputError(source, "nan or inf", "every strain and force must be finite")
    if (np.diff(strain) < 0).any():
        at = int(np.argmax(np.diff(strain) < 0)) + 1
        raise InputError(f"{source}: strain[{at}]", f"{strain[at]:g}", "the strain must not fall")
    if not force.max() > 0:
        raise InputError(f"{source}: force", f"{force.max():g} N at most", "must rise above 0")
    return strain, force


def _plausible(fits):
    """The fits that need their change of slope and that the best of them does not rule out."""
    kinked = [one for one in fits if one.criterion < one.criterion_straight]
    return [one for one in kinked if one.criterion <= kinked[0].criterion + RULED_OUT]


def _other(kind):
    return next(name for name in KINDS if name != kind)


def _other_kind(e, f, kind, criterion):
    """Whether the other kind fits with a lower criterion."""
    other = _plausible(piecewise_fit.fits(e, f, KINDS[_other(kind)][3]))
    return bool(other) and other[0].criterion < criterion


def _refuse(e, f, kind, source):
    rank = "falls" if KINDS[kind][3] else "rises"
    hint = f"; kind {_other(kind)} describes it" if _other_kind(e, f, kind, np.inf) else ""
    raise InputError(
        source,
        f"kind {kind}",
        f"needs a slope that {rank} along the curve with three points on each side of the change, "
        f"and this one's does not{hint}",
    )


def _estimates(plausible, kind):
    """name -> Estimate: values of the first fit, intervals covering those of all plausible fits."""
    first, *rivals = (_estimates_of(found, kind) for found in plausible)
    covering = {}
    for name, estimate in first.items():
        others = [rival[name] for rival in rivals if not rival[name].note]
        if others and (not estimate.note or estimate.note == _NOT_NEEDED):
            # nan where the first fit has the constant at 0 without an interval of its own.
            low = np.nanmin([estimate.value, estimate.low, *(other.low for other in others)])
            high = np.nanmax([estimate.value, estimate.high, *(other.high for other in others)])
            estimate = Estimate(estimate.value, float(low), float(high), estimate.unit)
        covering[name] = estimate
    return covering


def _estimates_of(found, kind):
    first, second, kink, falling = KINDS[kind]
    names = (first, second, kink, "slack", "toe_half_width")
    notes = dict.fromkeys(names, "")
    larger, smaller = (first, second) if falling else (second, first)
    depends = dict(zip(piecewise_fit.PARAMETERS, (larger, smaller, *names[2:]), strict=True))
    for parameter in found.at_bound:
        notes[depends[parameter]] = _AT_BOUND
    for parameter in set(piecewise_fit.PARAMETERS) - set(piecewise_fit.ONSETS[found.onset]):
        notes[depends[parameter]] = _NOT_NEEDED
    values = dict(zip(names, found.constants.tolist(), strict=True))
    gradients = dict(zip(names, np.eye(5), strict=True))
    units = dict(zip(names, ("N", "N", "1", "1", "1"), strict=True))
    if kind == "two_slope":
        low, high, switch = found.constants[:3]
        values["offset"] = float((high - low) * switch)
        gradients["offset"] = np.array([-switch, switch, high - low, 0.0, 0.0])
        units["offset"], notes["offset"] = "N", notes[first] or notes[kink]
    estimates = {}
    for name, value in values.items():
        half = np.nan if notes[name] else piecewise_fit.half_width(found, gradients[name])
        estimates[name] = Estimate(value, value - half, value + half, units[name], notes[name])
    return estimates


def _systematic(strain, deviation):
    """Largest deviation that averaging does not remove, and its strain; 0 if noise explains all.

    Averages run over a twelfth of the points, five at least; five standard errors are noise.
    """
    count = max(5, deviation.size // 12)
    scatter = noise(strain, deviation)
    means = np.convolve(deviation, np.full(count, 1 / count), mode="valid")
    at = int(np.argmax(np.abs(means)))
    largest = float(abs(means[at]))
    middle = float(strain[at + count // 2])
    return (largest if largest > 5 * scatter / np.sqrt(count) else 0.0), middle


def _notes(fits, found, systematic, at, breaking):
    notes = []
    if systematic > GOOD:
        where = f"two lines miss the curve by {100 * systematic:.2g} % near strain {at:.3g}"
        notes.append(where + (", near the break: a third region" if at > 0.75 * breaking else ""))
        notes.append("the intervals are too narrow, as deviations are not independent")
    line = min(fits, key=lambda one: one.criterion_straight)
    if line.criterion_straight < found.criterion - RULED_OUT:
        notes.append(f"one line after {line.onset} describes the curve better than two")
    if found.at_bound:
        notes.append("some constants have no interval")
    return notes


def _statement(verdict, deviations, onset, breaking, break_seen, notes):
    removed = {"none": "no slack", "slack": "slack removed"}
    comparison = "at" if break_seen else "not seen up to"
    parts = [
        f"{verdict} fit: deviation rms {100 * deviations['rms_deviation']:.3g} %, "
        f"at most {100 * deviations['max_deviation']:.3g} % of the largest force "
        f"(at strain {deviations['max_deviation_strain']:.3g}), R2 = {deviations['r_squared']:.6f}",
        removed.get(onset, "slack and toe removed"),
        f"break {comparison} strain {breaking:.4g}",
    ]
    return "; ".join(parts + notes)
