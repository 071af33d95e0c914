"""Measures of a fabric that follow from its loop and the count of its yarn."""

import math
from dataclasses import dataclass

from knitsim.errors import InputError
from knitsim.units import from_si


@dataclass(frozen=True)
class FabricMeasures:
    """All SI but the tightness factor, which is a number of its own units by definition.

    stitch_density: loops per m2.  wales, courses: per m.  loop_length, thickness: m.
    tightness_factor: sqrt(tex) / cm.  areal_mass: kg/m2.  yarn_per_area: m/m2.
    cover: share of the area under yarn, l d / (w c), overlaps counted twice (may exceed 1).
    porosity: share of the fabric's volume (area times thickness) outside the yarn's pi d2/4 l.
    kc, kw, ks: Munden's l/c, l/w, l2/(w c).  loop_shape: w/c.
    smallest_distance: between centre lines, in diameters.
    """

    stitch_density: float
    wales: float
    courses: float
    loop_length: float
    thickness: float
    tightness_factor: float
    areal_mass: float
    yarn_per_area: float
    cover: float
    porosity: float
    kc: float
    kw: float
    ks: float
    loop_shape: float
    smallest_distance: float


def fabric_measures(loop, linear_density):
    """:class:`FabricMeasures` of a Loop and its yarn's linear density (kg/m) > 0."""
    if not (math.isfinite(linear_density) and linear_density > 0):
        raise InputError("linear density", linear_density, "must be a finite number above 0 (kg/m)")
    w, c, d, length = loop.wale_spacing, loop.course_spacing, loop.diameter, loop.loop_length
    area = w * c
    return FabricMeasures(
        stitch_density=1 / area,
        wales=1 / w,
        courses=1 / c,
        loop_length=length,
        thickness=loop.thickness,
        tightness_factor=math.sqrt(from_si(linear_density, "tex")) * from_si(1 / length, "per_cm"),
        areal_mass=linear_density * length / area,
        yarn_per_area=length / area,
        cover=length * d / area,
        porosity=1 - math.pi / 4 * d**2 * length / (area * loop.thickness),
        kc=length / c,
        kw=length / w,
        ks=length**2 / area,
        loop_shape=w / c,
        smallest_distance=loop.nearest.distance / d,
    )
