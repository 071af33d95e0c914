"""The loop of a fabric: centre line, frames, fibre points, crossings and measures."""

import functools

import numpy as np
import xarray as xr

from knitsim.errors import InputError
from knitsim.loop.build import build_loop
from knitsim.loop.choi_lo import choi_lo
from knitsim.loop.frames import loop_frames
from knitsim.loop.inclination import ORDERS, angle_error, backward_share, inclined_frames
from knitsim.loop.lattice import crossings, crossings_intact
from knitsim.loop.measures import fabric_measures
from knitsim.loop.peirce import peirce, peirce_length
from knitsim.stages.described import describe_stage
from knitsim.stages.ledger import effect_dataset
from knitsim.stages.yarn import layout_of, signed_twist
from knitsim.store.tensile import loop_coordinates
from knitsim.store.timing import Timings
from knitsim.study.schema import closure

STAGE = "loop"
# Points of the centre line at which the angle error of eqs (2), (3) is taken.
_MANY = 2000


def loop_of(fabric):
    """The Loop of a FabricInput.  Raises InputError for one that does not exist."""
    return _built(
        fabric["wale_spacing"], fabric["course_spacing"], fabric.yarn["diameter"],
        fabric["loop_length"], fabric["centre_line"], fabric.where("")[:-1],
    )  # fmt: skip


@functools.lru_cache(maxsize=32)
def _built(wale_spacing, course_spacing, diameter, loop_length, centre_line, where):
    # The ledger comes back to the same loop with every assumption that does not change it.
    return build_loop(
        wale_spacing, course_spacing, diameter, loop_length, centre_line=centre_line, where=where
    )


def headlines(fabric):
    """{name: (value, units)} of the loop's measures that the ledger follows."""
    loop = loop_of(fabric)
    measures = fabric_measures(loop, fabric.yarn["linear_density"])
    return {
        "loop_length": (loop.loop_length, "m"),
        "min_distance": (measures.smallest_distance, "1"),
        "tightness_factor": (measures.tightness_factor, "tex0.5 cm-1"),
        "areal_mass": (measures.areal_mass, "kg m-2"),
        "thickness": (measures.thickness, "m"),
    }


def _printed_frames(loop, sections, arc, twist):
    """Section axes by the printed eqs (2), (3), and their angle error, in both orders of turning."""
    u, _ = loop.sections(sections)
    many = loop.derivative((np.arange(_MANY) + 0.5) / _MANY)
    axes = [
        inclined_frames(loop.points(u), arc, loop.spline.period, twist, order).tangents
        for order in ORDERS
    ]
    median = [float(np.median(angle_error(many, order))) for order in ORDERS]
    diagonal = [float(angle_error(np.ones(3), order)) for order in ORDERS]
    return {
        "printed_section_axis": (("order", "section", "axis"), np.array(axes)),
        "section_angle_error": ("order", median),
        "section_angle_error_of_diagonal": ("order", diagonal),
        "backward_share": backward_share(many),
    }


def _peirce_points(loop, count):
    """Centre line of Peirce's own loop at these spacings (count + 1, 3), or NaN where there is none."""
    try:
        source = peirce(loop.wale_spacing, loop.course_spacing, loop.diameter, "peirce")
    except InputError:
        return np.full((count + 1, 3), np.nan)
    return source.points(source.loop_length * np.arange(count + 1) / count)


def run(fabric):
    """(dataset, timings) of a FabricInput."""
    timings = Timings(STAGE, fabric.name)
    sections = fabric["sections_per_loop"]
    twist = signed_twist(fabric.yarn)
    with timings.measure("loop, crossings and smallest distance"):
        loop = loop_of(fabric)
        line = loop.polyline(400)
        found = crossings(line, loop.lattice)
        measures = fabric_measures(loop, fabric.yarn["linear_density"])
    layout = layout_of(fabric.yarn)
    with timings.measure(f"frames and {sections} x {layout.fibres} fibre points"):
        frames = loop_frames(loop, sections, twist)
        fibres = frames.fibre_points(layout.positions)
    chi = loop.parameters["chi"]
    source = choi_lo(loop.wale_spacing, loop.course_spacing, loop.diameter, chi)
    closing = frames.points[:1] + loop.spline.period
    data = {
        "centreline": (("loop", "point", "axis"), np.concatenate([frames.points, closing])[None]),
        "arc_length": ("point", frames.arc),
        "tangent": (("section", "axis"), frames.tangents),
        "normal": (("section", "axis"), frames.normals),
        "binormal": (("section", "axis"), frames.binormals),
        "frame_closure_angle": frames.holonomy,
        "turn_per_loop": frames.turn_per_loop,
        "fibre_point": (("section", "fibre", "axis"), fibres),
        "anchor_point": (("anchor", "axis"), loop.anchors),
        "curve_point": (("point", "axis"), source.points(2.0 * np.arange(sections + 1) / sections)),
        "peirce_point": (("point", "axis"), _peirce_points(loop, sections)),
        **_printed_frames(loop, sections, frames.arc, twist),
        "wale_spacing": loop.wale_spacing,
        "course_spacing": loop.course_spacing,
        "diameter": loop.diameter,
        "loop_length": loop.loop_length,
        "loop_height": float(np.ptp(line[:, 1])),
        "thickness": measures.thickness,
        "choi_lo_parameter": chi,
        "stitch_density": measures.stitch_density,
        "tightness_factor": measures.tightness_factor,
        "areal_mass": measures.areal_mass,
        "cover": measures.cover,
        "min_distance": measures.smallest_distance,
        "crossings_intact": np.int8(crossings_intact(line, loop.lattice)),
        "neighbour": ("crossing", np.array([c.neighbour for c in found], dtype=np.int8)),
        "over": ("crossing", np.array([c.side == "over" for c in found], dtype=np.int8)),
        "twist": twist,
        "fibre_diameter": layout.fibre_diameter,
        "peirce_loop_length": peirce_length(loop.wale_spacing, loop.course_spacing, loop.diameter),
    }
    coords = {
        **loop_coordinates(sections + 1),
        "section": np.arange(sections),
        "fibre": np.arange(layout.fibres),
        "anchor": np.arange(len(loop.anchors)),
        "crossing": np.arange(len(found)),
        "order": list(ORDERS),
    }
    dataset = xr.Dataset(data, coords)
    with timings.measure("effect of the assumptions"):
        dataset = xr.merge([dataset, effect_dataset(fabric, closure(STAGE), headlines)])
    describe_stage(
        dataset, fabric, STAGE, title=f"Loop of the fabric {fabric.name}",
        summary="Centre line, frames, fibre points, crossings and measures of one loop.",
        references=("paper", "choi_lo", "peirce", "wang"),
    )  # fmt: skip
    return dataset, timings
