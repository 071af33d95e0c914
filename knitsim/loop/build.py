"""The loop of a fabric: its centre line, how it interlaces, and the measures of the fabric."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from knitsim.errors import InputError
from knitsim.loop import choi_lo, peirce
from knitsim.loop.centreline import PeriodicSpline, periodic_spline
from knitsim.loop.lattice import Nearest, crossings_intact, smallest_distance_of_spline
from knitsim.loop.length import DENSE, centre_line_of, chi_for_length, closed
from knitsim.units import from_si

GEOMETRIES = ("choi_lo", "peirce")
CENTRE_LINES = ("spline", "curve")

CLOSEST = 0.5  # diameters: yarns whose centre lines come closer are refused


@dataclass(frozen=True, eq=False)
class Loop:
    """One loop of a plain weft-knitted fabric, as built.

    wale_spacing, course_spacing, diameter, loop_length: m; the loop length is that of ``spline``.
    geometry: "choi_lo" or "peirce"; centre_line: "spline" (through the anchors) or "curve".
    anchors: (k + 1, 3), m, the last closing the period.  parameters: the numbers that the geometry
    solved for (SI), by their name in the source.  nearest: where two yarns come closest; the cotton
    loop of the paper overlaps there by some percent of its diameter.
    """

    wale_spacing: float
    course_spacing: float
    diameter: float
    loop_length: float
    geometry: str
    centre_line: str
    spline: PeriodicSpline
    anchors: np.ndarray
    parameters: dict
    nearest: Nearest

    @property
    def lattice(self):
        """(2, 3), m: to the next loop of the course, and to the loop of the next course."""
        return np.array([[self.wale_spacing, 0.0, 0.0], [0.0, self.course_spacing, 0.0]])

    @property
    def nodes(self):
        """Gauss points (q,) in u: integral of f(u) du over the loop = sum(weights f(nodes))."""
        return self.spline.nodes

    @property
    def weights(self):
        """Weights (q,) of :attr:`nodes`; the arc length is sum(weights |derivative(nodes)|)."""
        return self.spline.weights

    def points(self, u):
        """Centre line (..., 3), m, at u (...): from one sinker loop's middle, 0, to the next, 1."""
        return self.spline.points(u)

    def derivative(self, u, order=1):
        """d^order r / du^order (..., 3), m."""
        return self.spline.derivative(u, order)

    def sections(self, count=100):
        """u (count,) and arc length (count + 1,), m, of sections at equal arc length."""
        return self.spline.sections(count)

    def polyline(self, count=200):
        """Points (count + 1, 3), m, at equal steps of u over the period, both ends included."""
        return self.spline.points(np.arange(count + 1) / count)

    @property
    def thickness(self):
        """Thickness of the fabric, m: of the centre line, and one diameter."""
        thickness = self.spline.points(np.linspace(0.0, 1.0, 2001))[:, 2]
        return float(np.ptp(thickness)) + self.diameter


def build_loop(
    wale_spacing,
    course_spacing,
    diameter,
    loop_length=None,
    geometry="choi_lo",
    centre_line="spline",
    where="loop",
):
    """The loop with these spacings, diameter and loop length (m).

    geometry "choi_lo": chi is solved so that the modelled centre line has the stated loop length,
    on the branch above the shortest one.  centre_line "spline": one periodic cubic spline through
    six anchors on each half loop, the paper's method; "curve": the curve of Choi and Lo itself.
    geometry "peirce": the curve itself (centre_line is not read); its length follows from
    l = 2 c + w + 5.94 d, so loop_length must be None.

    ``where`` stands before the key in messages, e.g. ``config/fabrics.yaml: cotton``.

    Raises InputError, naming the key: a size that is not positive; a loop length below the shortest
    or above the longest at these spacings; centre lines closer than half a diameter; yarns that are
    not interlooped.
    """
    if geometry not in GEOMETRIES:
        raise InputError(f"{where}.geometry", geometry, f"must be one of {', '.join(GEOMETRIES)}")
    if centre_line not in CENTRE_LINES:
        raise InputError(
            f"{where}.centre_line", centre_line, f"must be one of {', '.join(CENTRE_LINES)}"
        )
    sizes = {"wale_spacing": wale_spacing, "course_spacing": course_spacing, "diameter": diameter}
    if geometry == "choi_lo":
        sizes["loop_length"] = loop_length
    elif loop_length is not None:
        raise InputError(
            f"{where}.loop_length_mm", f"{from_si(loop_length, 'mm'):.5g}",
            "must be left out with Peirce's loop, which sets it (2 c + w + 5.94 d)",
        )  # fmt: skip
    for name, size in sizes.items():
        if size is None or not (math.isfinite(size) and size > 0):
            shown = "nothing" if size is None else f"{from_si(size, 'mm'):.5g}"
            raise InputError(f"{where}.{name}_mm", shown, "must be a finite number above 0")

    if geometry == "peirce":
        source = peirce.peirce(wale_spacing, course_spacing, diameter, where)
        centre_line = "curve"
        anchors = closed(source.points(source.joints()), wale_spacing)
        arc = _subdivide(source.joints(), source.loop_length / DENSE)
        spline = periodic_spline(closed(source.points(arc), wale_spacing))
        parameters = {"radius": source.radius, "exact_length": source.loop_length}
    else:
        chi = chi_for_length(
            wale_spacing, course_spacing, diameter, loop_length, centre_line, where
        )
        source = choi_lo.choi_lo(wale_spacing, course_spacing, diameter, chi, where)
        anchors = source.anchors()
        spline = centre_line_of(source, centre_line)
        names = ("chi", "a", "e", "h", "b1", "t3", "t4")
        parameters = {name: getattr(source, name) for name in names}
    lattice = np.array([[wale_spacing, 0.0, 0.0], [0.0, course_spacing, 0.0]])
    if not crossings_intact(spline.points(np.arange(401) / 400), lattice):
        raise InputError(
            f"{where}.loop_length_mm", f"{from_si(spline.length, 'mm'):.5g}",
            "gives loops that do not interlace as in plain knit at these spacings; must be nearer "
            f"to Peirce's 2 c + w + 5.94 d = {_peirce_length(sizes):.4g} mm",
        )  # fmt: skip
    nearest = smallest_distance_of_spline(spline, lattice, diameter)
    if nearest.distance < CLOSEST * diameter:
        raise InputError(
            f"{where}.diameter_mm", f"{from_si(diameter, 'mm'):.4g}",
            f"brings centre lines as close as {nearest.distance / diameter:.2f} diameters; must "
            f"leave at least {CLOSEST:g}: use a thinner yarn, wider spacings or a loop length "
            f"nearer to Peirce's 2 c + w + 5.94 d = {_peirce_length(sizes):.4g} mm",
        )  # fmt: skip
    return Loop(
        float(wale_spacing), float(course_spacing), float(diameter), spline.length, geometry,
        centre_line, spline, anchors, parameters, nearest,
    )  # fmt: skip


def _peirce_length(sizes):
    length = 2 * sizes["course_spacing"] + sizes["wale_spacing"] + 5.94 * sizes["diameter"]
    return from_si(length, "mm")


def _subdivide(arc, step):
    """``arc`` (k,) with further values so that none lie further apart than ``step``."""
    pieces = [
        np.linspace(start, end, math.ceil((end - start) / step), endpoint=False)
        for start, end in itertools.pairwise(arc)
    ]
    return np.concatenate([*pieces, arc[-1:]])
