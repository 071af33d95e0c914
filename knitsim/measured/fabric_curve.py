"""Measured curves of a fabric: tension (strain and force per width) and bending, read and corrected.

A file of a tension test looks like this (columns and comments as in
:mod:`knitsim.measured.yarn_curve`)::

    # gauge_length_mm: 100
    # width_mm: 50
    # pretension_gf_per_cm: 2
    # machine_compliance_mm_per_N: 0.012
    extension_mm,force_N,lateral_strain_percent

Loading comes first; a recovery, if it was measured, follows the largest strain.
"""

from dataclasses import dataclass

import numpy as np

from knitsim.errors import InputError
from knitsim.measured.yarn_curve import read_curve
from knitsim.units import from_si, to_si

LEAST_LOADING = 4  # points of loading for a curve to fit to
LARGEST_STRAIN = 5.0
SMALLEST_STRAIN = 1e-3  # below it a whole curve is taken for one in another unit
LARGEST_FORCE = to_si(1e5, "N_per_m")
NOISE = 0.03  # part of the largest force, or strain, by which noise may go back
LOADING, RECOVERY = 0, 1
LARGEST_CURVATURE = to_si(100.0, "per_cm")
SMALLEST_CURVATURE = to_si(0.01, "per_cm")


@dataclass(frozen=True, eq=False)
class MeasuredTension:
    """A measured tension test of a fabric in SI, corrected; arrays (n,) in the order of the test.

    direction: course or wale.  strain (1): from the state under pretension (N/m, 0 without one), of
    the specimen alone.  force_per_width (N/m): over the starting width.  phase: 0 loading, 1
    recovery.  low, high, lateral_strain: ends of the band of the strain, and the strain across the
    pull, or None.  corrections: what was done to the numbers of the file, in words.
    """

    source: str
    direction: str
    strain: np.ndarray
    force_per_width: np.ndarray
    phase: np.ndarray
    low: np.ndarray | None
    high: np.ndarray | None
    lateral_strain: np.ndarray | None
    pretension: float
    corrections: tuple
    comments: tuple

    test = "tension"

    @property
    def loading(self):
        """Numbers of the points on loading."""
        return np.flatnonzero(self.phase == LOADING)


@dataclass(frozen=True, eq=False)
class MeasuredBending:
    """A measured bending test of a fabric: curvature (1/m, positive with the technical face convex)
    and moment per width (N), (n,) in the order of the test.  direction: the one that becomes curved;
    cycle: which one of the test, from 1.
    """

    source: str
    direction: str
    curvature: np.ndarray
    moment_per_width: np.ndarray
    corrections: tuple
    comments: tuple
    cycle: int = 1

    test = "bending"


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


def read_measured(fabric, name):
    """The MeasuredTension or MeasuredBending ``name`` of a FabricInput.  Raises InputError."""
    entry, path = fabric["measured"][name], fabric.measured_path(name)
    if entry["test"] == "bending":
        return read_bending(path, entry["direction"], cycle=entry["cycle"])
    return read_tension(
        path, entry["direction"], gauge_length=entry["gauge_length"], width=entry["width"],
        pretension=entry["pretension"], machine_compliance=entry["machine_compliance"],
    )  # fmt: skip


def read_tension(
    path, direction, *, gauge_length=None, width=None, pretension=None, machine_compliance=None
):
    """The MeasuredTension in the CSV file at ``path``.

    gauge_length, width (m), pretension (N/m), machine_compliance (m/N): before those of the file's
    comments.  The extension of the machine, compliance times force, is subtracted; strain is then
    counted from where loading passes the pretension, and what lies before is left out.

    Raises InputError with file, line, value and what is right for a file that makes no sense.
    """
    where = str(path)
    curve = read_curve(
        path, ("strain", "force_per_width"), least_points=LEAST_LOADING,
        gauge_length=gauge_length, width=width,
        optional=("lateral_strain", "strain_low", "strain_high"),
    )  # fmt: skip
    strain, force = curve["strain"].copy(), curve["force_per_width"]
    band = [curve.values.get(name) for name in ("strain_low", "strain_high")]
    lateral = curve.values.get("lateral_strain")
    _refuse_other_units(where, curve, strain, force)
    _refuse_band(where, curve, strain, *band)
    if lateral is not None:
        _refuse(where, curve, "lateral_strain", lateral <= -1.0, "must be above -1 (-100 %)")
        _refuse(where, curve, "lateral_strain", lateral > LARGEST_STRAIN,
                f"must be at most {LARGEST_STRAIN:g} ({100 * LARGEST_STRAIN:g} %)")  # fmt: skip
    top = int(np.argmax(strain))
    _refuse_disorder(where, curve, strain, force, top)
    if top + 1 < LEAST_LOADING:
        raise curve.refused(
            where, "strain", top,
            f"is the largest strain after {top + 1} points of loading; at least {LEAST_LOADING} are "
            "needed (loading comes first, then recovery)",
        )  # fmt: skip
    given = {**curve.metadata}
    for name, value in (("pretension", pretension), ("machine_compliance", machine_compliance)):
        if value is not None:
            given[name] = value
    corrections = []
    if "machine_compliance" in given:
        shift = _machine_strain(where, given, force)
        strain = strain - shift
        band = [None if one is None else one - shift for one in band]
        part = float(shift[top] / (strain[top] + shift[top]))
        if part >= 1.0:
            raise InputError(
                f"{where}: machine_compliance",
                f"{from_si(given['machine_compliance'], 'mm_per_N'):.6g} mm/N",
                "explains all of the measured extension: nothing is left for the specimen",
            )
        corrections.append(
            f"extension of the machine subtracted, {100 * part:.2g} % of the largest extension"
        )
        _refuse_disorder(where, curve, strain, force, top)
    keep = np.arange(strain.size)
    if "pretension" in given:
        zero, across, keep = _zero_of(where, strain, force, top, given["pretension"], lateral)
        strain = from_pretension(strain, zero)
        lateral = None if lateral is None else from_pretension(lateral, across)
        band = [None if one is None else from_pretension(one, zero) for one in band]
        corrections.append(
            f"strain counted from a pretension of {from_si(given['pretension'], 'N_per_mm'):.4g} "
            f"N/mm, {100 * zero:.3g} % of strain in the file"
        )
    phase = np.where(np.arange(strain.size) <= top, LOADING, RECOVERY)
    return MeasuredTension(
        curve.source, direction, strain[keep], force[keep], phase[keep],
        *(None if one is None else one[keep] for one in (*band, lateral)),
        given.get("pretension", 0.0), tuple(corrections), curve.comments,
    )  # fmt: skip


def read_bending(path, direction, *, cycle=1):
    """The MeasuredBending in the CSV file at ``path``: columns curvature and moment_per_width.

    The curvature runs from flat to one side, to the other and back, or a part of that.  cycle: which
    one of the test it is.  Raises InputError as :func:`read_tension`.
    """
    where = str(path)
    curve = read_curve(path, ("curvature", "moment_per_width"), least_points=LEAST_LOADING)
    curvature, moment = curve["curvature"], curve["moment_per_width"]
    largest = float(np.abs(curvature).max())
    for wrong, right in (
        (largest > LARGEST_CURVATURE, "at most 100 per cm"),
        (largest < SMALLEST_CURVATURE, "0.01 per cm or more at its largest"),
    ):
        if wrong:
            raise InputError(
                f"{where}: curvature", f"{from_si(largest, 'per_cm'):.4g} per cm at most",
                f"must be {right}: is the unit in the header right?",
            )  # fmt: skip
    steps = np.diff(curvature)
    steps = np.where(np.abs(steps) <= NOISE * largest, 0.0, steps)
    signs = np.sign(steps[steps != 0.0])
    turns = int((signs[1:] != signs[:-1]).sum())
    if turns > 3:
        raise InputError(
            f"{where}: curvature", f"turns back {turns} times",
            "must be sorted as tested: to one side, to the other and back, of one cycle",
        )  # fmt: skip
    if curvature.min() > NOISE * largest or curvature.max() < -NOISE * largest:
        raise InputError(
            f"{where}: curvature", f"{from_si(curvature.min(), 'per_cm'):.4g} per cm at least",
            "must pass the flat fabric, curvature 0: moments count from there",
        )  # fmt: skip
    slope = np.polynomial.polynomial.polyfit(curvature / largest, moment, 1)[1]
    if not slope > 0:
        raise InputError(
            f"{where}: moment_per_width", f"mean slope {slope / largest:.4g} N m",
            "must rise with the curvature (both positive with the technical face convex)",
        )  # fmt: skip
    return MeasuredBending(curve.source, direction, curvature, moment, (), curve.comments, cycle)


def _refuse(where, curve, name, bad, right):
    """InputError with the line of the first bad point, if any."""
    if bad.any():
        raise curve.refused(where, name, int(np.argmax(bad)), right)


def _refuse_other_units(where, curve, strain, force):
    most = float(strain.max())
    if most > LARGEST_STRAIN:
        raise InputError(
            f"{where}: strain", f"{most:.6g} at most",
            f"must be at most {LARGEST_STRAIN:g}: is it in per cent? then name the column "
            "strain_percent",
        )  # fmt: skip
    if most < SMALLEST_STRAIN:
        raise InputError(
            f"{where}: strain", f"{most:.6g} at most",
            f"must reach {SMALLEST_STRAIN:g}: no fabric test is that small; is it a fraction named "
            "strain_percent, or the wrong unit of extension?",
        )  # fmt: skip
    _refuse(where, curve, "strain", strain < -0.5, "must be above -0.5: a pull lengthens")
    largest = float(force.max())
    if not largest > 0:
        raise InputError(f"{where}: force", f"{largest:g} N/m at most", "must rise above 0")
    if largest > LARGEST_FORCE:
        raise InputError(
            f"{where}: force", f"{largest:.4g} N/m at most",
            f"must be at most {LARGEST_FORCE:g} N/m: is the unit in the header right?",
        )  # fmt: skip
    _refuse(where, curve, "force_per_width", force < -NOISE * largest,
            "must not be negative (noise of 3 % of the largest is passed over)")  # fmt: skip


def _refuse_band(where, curve, strain, low, high):
    if (low is None) != (high is None):
        missing = "strain_low" if low is None else "strain_high"
        raise InputError(f"{where}: {missing}", None, "is missing; a band has both ends")
    if low is not None:
        _refuse(where, curve, "strain_low", low > strain, "must not be above the strain")
        _refuse(where, curve, "strain_high", high < strain, "must not be below the strain")


def _refuse_disorder(where, curve, strain, force, top):
    """Loading must rise, recovery must fall, in strain and in force, but for noise."""
    for name, values, what in (("strain", strain, "strain"), ("force_per_width", force, "force")):
        # The fall below what was reached before; on recovery the rise above.
        loading, recovery = values[: top + 1], values[top:]
        back = np.concatenate([
            np.maximum.accumulate(loading) - loading,
            (recovery - np.minimum.accumulate(recovery))[1:],
        ])  # fmt: skip
        bad = back > NOISE * np.ptp(values)
        if bad.any():
            first = int(np.argmax(bad))
            way = "falls on loading" if first <= top else "rises on recovery"
            raise curve.refused(
                where, name, first,
                f"{what} {way}: points must be in the order of the test, loading then recovery of "
                "one cycle",
            )  # fmt: skip


def _machine_strain(where, given, force):
    """Strain that is the machine's: compliance times force over the gauge length."""
    for name, example in (("gauge_length", "gauge_length_mm"), ("width", "width_mm")):
        if name not in given:
            raise InputError(
                f"{where}: {name}", None,
                f"is missing: a machine compliance needs '# {example}: ...' or the key {example}",
            )  # fmt: skip
    return given["machine_compliance"] * force * given["width"] / given["gauge_length"]


def _zero_of(where, strain, force, top, pretension, lateral):
    """Strain and lateral strain at which loading passes the pretension (0 if it starts there), points
    kept."""
    if pretension >= force[: top + 1].max():
        raise InputError(
            f"{where}: pretension", f"{from_si(pretension, 'N_per_mm'):.6g} N/mm",
            f"must be below the largest force, {from_si(force.max(), 'N_per_mm'):.6g} N/mm",
        )  # fmt: skip
    above = int(np.argmax(force > pretension * (1.0 + 1e-9)))
    if above == 0:
        # The file starts above the pretension: its zero is the state under pretension.
        return 0.0, 0.0, np.arange(strain.size)
    part = (pretension - force[above - 1]) / (force[above] - force[above - 1])
    zero, across = (
        0.0 if one is None else float(one[above - 1] + part * (one[above] - one[above - 1]))
        for one in (strain, lateral)
    )
    numbers = np.arange(strain.size)
    return zero, across, numbers[(numbers >= above) & ((numbers <= top) | (force >= pretension))]
