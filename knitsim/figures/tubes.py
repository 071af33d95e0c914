"""Yarns drawn as shaded solid tubes on real axes.

:func:`render_tubes` turns polylines into a picture with its extent, :func:`draw_tubes` puts that
on matplotlib axes in mm, and :func:`fabric_polylines` repeats one loop into a piece of fabric.
Points are (..., 3) in metres with axes course, wale, thickness.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.colors import to_rgb

from knitsim.errors import InputError
from knitsim.figures import tubes_kernels as kernels
from knitsim.figures.panels import scale_bar
from knitsim.figures.style import DPI, YARN_COLOURS
from knitsim.loop.frames import line_frames
from knitsim.loop.repeat import fabric_courses
from knitsim.units import from_si

LARGEST_PICTURE = 20_000_000  # pixels; four samples each
MAP_RESOLUTION = 12.0  # cells of the shadow map in a yarn radius: its edges are soft over a quarter
FINEST_MAP = 2.0  # cells in a sample of the picture: of a finer map nothing would be seen
LARGEST_MAP = 2000  # cells along one side of the shadow map, without its margin
MAP_MARGIN = 4  # cells round it, more than its filter reaches
RIDGES = 7  # ridges round the yarn in the optional texture


@dataclass(frozen=True)
class View:
    """An orthographic view: unit vectors (course, wale, thickness) to the right, up, to the eye.

    The labels name what the two axes of the picture show; None where they show no fabric axis.
    """

    right: tuple
    up: tuple
    eye: tuple
    right_label: str | None = None
    up_label: str | None = None

    def project(self, points):
        """Points (..., 3) as (to the right, up, to the eye), same shape and unit."""
        return np.asarray(points, dtype=float) @ np.array([self.right, self.up, self.eye]).T


_COURSE, _WALE, _THICKNESS = "course direction", "wale direction", "thickness"

VIEWS = {
    # The technical face, and the technical back with the wales still upwards.
    "face": View((1, 0, 0), (0, 1, 0), (0, 0, 1), _COURSE, _WALE),
    "back": View((-1, 0, 0), (0, 1, 0), (0, 0, -1), f"{_COURSE} from the back", _WALE),
    # Sections: the named direction lies across the picture, the technical face is up.
    "side_course": View((1, 0, 0), (0, 0, 1), (0, -1, 0), _COURSE, _THICKNESS),
    "side_wale": View((0, 1, 0), (0, 0, 1), (1, 0, 0), _WALE, _THICKNESS),
}
OBLIQUE = (-24.0, -42.0)  # azimuth and elevation (degrees) of the view "oblique"


def view_of(view):
    """The :class:`View` named by ``view``: a View, a preset's name or (azimuth, elevation).

    Presets: face, back, side_course, side_wale, oblique.  Angles are in degrees and say where the
    eye is: azimuth turns it from the technical face towards the course direction, elevation then
    lifts it towards the wale direction; wales stay upright in the picture.
    """
    if isinstance(view, View):
        return view
    if isinstance(view, str):
        if view == "oblique":
            return view_of(OBLIQUE)
        if view not in VIEWS:
            raise InputError("view", view, f"use one of {', '.join(VIEWS)}, oblique or two angles")
        return VIEWS[view]
    azimuth, elevation = np.radians(np.asarray(view, dtype=float).reshape(2))
    if not (np.isfinite(azimuth) and abs(elevation) < np.pi / 2):
        raise InputError("view", view, "azimuth finite, elevation between -90 and 90 degrees")
    sa, ca, se, ce = np.sin(azimuth), np.cos(azimuth), np.sin(elevation), np.cos(elevation)
    return View((ca, 0.0, -sa), (-se * sa, ce, -se * ca), (ce * sa, se, ce * ca))


@dataclass(frozen=True)
class FabricYarns:
    """A piece of fabric: per course one polyline (m, 3) (m) and its colours (m, 3), RGB 0..1."""

    polylines: list
    colours: list


def fabric_polylines(
    loops,
    wale_spacing,
    course_spacing,
    loops_wide=4,
    loops_high=4,
    *,
    courses=1,
    colours="courses",
    slant=0.0,
    centred=False,
):
    """One continuous polyline per course of the fabric, with colours; :class:`FabricYarns`.

    loops: (loop, m, 3) (m), those of the repeating cell as the store has them, or one (m, 3); the last
    point of a loop is the first of the next one in its course.  courses: in the cell.  The spacings
    (m) and, in a sheared fabric, ``slant`` (m) along the course from course to course repeat it.  The
    first loop lies where it was given, or, if ``centred``, the middle of the piece lies at the origin
    of course and wale.

    colours: "courses" alternates two colours by course; an array (m, 3) or (loop, m, 3) colours the
    points of each loop, say by tension; one colour is for all.
    """
    loops = np.asarray(loops, dtype=float)
    loops = loops[None] if loops.ndim == 2 else loops
    if loops.ndim != 3 or loops.shape[2] != 3 or loops.shape[1] < 3 or not np.isfinite(loops).all():
        raise InputError("loops", loops.shape, "finite points (loop, m, 3), at least 3 of each")
    for name, value in (("wale_spacing", wale_spacing), ("course_spacing", course_spacing)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(name, value, "must be above 0 (m)")
    for name, value in (("loops_wide", loops_wide), ("loops_high", loops_high)):
        if value != int(value) or value < 1:
            raise InputError(name, value, "must be a whole number from 1 on")
    size = loops_wide, loops_high
    polylines = fabric_courses(
        loops, wale_spacing, course_spacing, *size, courses=courses, slant=slant
    )
    if centred:
        shift = 0.5 * (polylines[0][[0, -1]].mean(0) + polylines[-1][[0, -1]].mean(0))
        # The middle of the wale direction is that of the loops, not that of their first points.
        shift[1] += 0.5 * (loops[0, :, 1].min() + loops[0, :, 1].max()) - loops[0, 0, 1]
        shift[2] = 0.0
        polylines = [points - shift for points in polylines]
    if isinstance(colours, str) and colours == "courses":
        rows = [to_rgb(YARN_COLOURS["dark" if j % 2 else "pale"]) for j in range(loops_high)]
        return FabricYarns(polylines, [np.tile(rgb, (len(polylines[0]), 1)) for rgb in rows])
    rgb = np.asarray(to_rgb(colours) if isinstance(colours, str) else colours, dtype=float)
    if rgb.shape not in ((3,), loops.shape[1:], loops.shape):
        raise InputError("colours", rgb.shape, f"one colour or {loops.shape}, RGB per point")
    painted = np.broadcast_to(rgb, loops.shape)
    # Repeated as the loops are, from one place.
    return FabricYarns(polylines, fabric_courses(painted, 0.0, 0.0, *size, courses=courses))


@dataclass(frozen=True)
class TubeImage:
    """A picture: rgba (rows, columns, 4) uint8, top row first, clear where there is no yarn.

    extent: left, right, bottom, top (m) in the plane of the view, as imshow wants it.
    """

    rgba: np.ndarray
    extent: tuple


def render_tubes(
    polylines,
    radius,
    colours,
    view="face",
    *,
    pixel=None,
    window=None,
    light=(-0.42, 0.52, 0.74),
    twist=0.0,
    ridges=RIDGES,
):
    """Solid yarns, lit, with shadows and darkened crossings, seen in parallel: :class:`TubeImage`.

    polylines: sequence of (m, 3) points (m); equal points in a row count once.
    radius: one (m), one per polyline, or per polyline one per point.
    colours: one RGB (0..1) or matplotlib colour, one per polyline, or per polyline one per point.
    view: see :func:`view_of`.  pixel: its size (m); by default the longer side has 1200.
    window: left, right, bottom, top (m) in the plane of the view; by default all that is drawn
    and a margin of half a radius.  Yarn outside it still casts shadows.
    light: direction to the light (right, up, eye).
    twist: with a value other than 0 the yarns get ridges along helices of so many turns per metre
    (positive: Z), ``ridges`` of them round the yarn.  They are an ornament that shows the twist's
    direction and angle, not computed fibres.

    Raises InputError for what cannot be drawn.
    """
    view = view_of(view)
    nodes, starts = _nodes(polylines, radius, colours, view)
    box = _window(window, nodes)
    if pixel is None:
        pixel = max(box[1] - box[0], box[3] - box[2]) / 1200.0
    if not (np.isfinite(pixel) and pixel > 0):
        raise InputError("pixel", pixel, "must be above 0 (m)")
    size = np.ceil(np.array([box[3] - box[2], box[1] - box[0]]) / pixel - 1e-9)
    if size.prod() > LARGEST_PICTURE:
        enough = pixel * float(np.sqrt(size.prod() / LARGEST_PICTURE))
        raise InputError("pixel", pixel, f"too small for this window: use at least {enough:.3g} m")
    rows, columns = (max(1, int(n)) for n in size)
    extent = (box[0], box[0] + columns * pixel, box[3] - rows * pixel, box[3])

    sample = 0.5 * pixel
    nodes[:, :3] = (nodes[:, :3] - [extent[0], extent[2], 0.0]) / sample
    nodes[:, kernels.RADIUS] /= sample
    _carry_frames(nodes, starts)
    depth, owner = _z_buffer(nodes[:, :3], nodes, starts, 2 * rows, 2 * columns)
    shadow, look = _shadow_map(nodes, starts, light)
    if twist:
        if not (np.isfinite(twist) and ridges == int(ridges) and ridges >= 1):
            raise InputError("twist, ridges", (twist, ridges), "finite, and a whole number from 1")
        look[kernels.HELIX], look[kernels.RIDGES] = 2.0 * np.pi * twist * sample, ridges
    picture = np.zeros((rows, columns, 4), dtype=np.uint8)
    sky = np.empty((rows, columns, 2), dtype=np.float32)
    kernels.look_up(nodes, depth, owner, sky)
    kernels.paint(nodes, depth, owner, sky, shadow, look, picture)
    return TubeImage(np.ascontiguousarray(picture[::-1]), extent)


def _carry_frames(nodes, starts):
    """Fill tangent, frame and arc length of the nodes of every yarn."""
    for first, end in pairwise(starts):
        yarn = nodes[first:end]
        tangents, normals = line_frames(yarn[:, :3])
        yarn[:, kernels.TANGENT : kernels.TANGENT + 3] = tangents
        yarn[:, kernels.FRAME : kernels.FRAME + 3] = normals
        steps = np.linalg.norm(np.diff(yarn[:, :3], axis=0), axis=1)
        yarn[1:, kernels.ARC] = np.cumsum(steps)


def _nodes(polylines, radius, colours, view):
    """All points as rows of the kernels' ``nodes`` (lengths in m); the first row of each yarn."""
    polylines = list(polylines)
    if not polylines:
        raise InputError("polylines", "[]", "at least one is needed")
    # One colour for all, as a name or three numbers; otherwise one entry a polyline.
    single = isinstance(colours, str) or (
        len(colours) == 3 and all(np.isscalar(c) and not isinstance(c, str) for c in colours)
    )
    radii = [radius] * len(polylines) if np.isscalar(radius) else list(radius)
    painted = [colours] * len(polylines) if single else list(colours)
    for name, given in (("radius", radii), ("colours", painted)):
        if len(given) != len(polylines):
            raise InputError(name, len(given), f"one for all or {len(polylines)}, one a polyline")
    blocks, starts = [], [0]
    for k, (points, r, colour) in enumerate(zip(polylines, radii, painted, strict=True)):
        points = np.asarray(points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise InputError(f"polylines[{k}]", points.shape, "must be finite points (m, 3)")
        block = np.zeros((len(points), kernels.NODE_WIDTH))
        block[:, :3] = view.project(points)
        try:
            block[:, kernels.RADIUS] = np.asarray(r, dtype=float)
            rgb = to_rgb(colour) if isinstance(colour, str) else np.asarray(colour, dtype=float)
            block[:, kernels.COLOUR : kernels.COLOUR + 3] = rgb
        except ValueError as error:
            raise InputError(f"radius or colours of polylines[{k}]", None, str(error)) from None
        if not (block[:, kernels.RADIUS] > 0).all():
            raise InputError(f"radius of polylines[{k}]", r, "must be above 0 (m)")
        rgb = block[:, kernels.COLOUR : kernels.COLOUR + 3]
        if not ((rgb >= 0) & (rgb <= 1)).all():
            raise InputError(f"colours of polylines[{k}]", None, "RGB must lie in 0..1")
        moved = np.linalg.norm(np.diff(points, axis=0), axis=1)
        block = block[np.concatenate([[True], moved > 1e-6 * block[:-1, kernels.RADIUS]])]
        if len(block) < 2:
            raise InputError(f"polylines[{k}]", len(points), "needs two different points")
        blocks.append(block)
        starts.append(starts[-1] + len(block))
    return np.concatenate(blocks), np.array(starts, dtype=np.int64)


def _window(window, nodes):
    """left, right, bottom, top (m): as asked, or round all nodes."""
    if window is None:
        radius = nodes[:, kernels.RADIUS]
        margin = 0.5 * radius.max()
        low = (nodes[:, :2] - radius[:, None]).min(0) - margin
        high = (nodes[:, :2] + radius[:, None]).max(0) + margin
        return float(low[0]), float(high[0]), float(low[1]), float(high[1])
    box = tuple(float(value) for value in window)
    if len(box) != 4 or not np.isfinite(box).all() or box[0] >= box[1] or box[2] >= box[3]:
        raise InputError("window", window, "left < right, bottom < top (m)")
    return box


def _z_buffer(points, nodes, starts, rows, columns, scale=1.0):
    depth = np.full((rows, columns), -np.inf, dtype=np.float32)
    owner = np.full((rows, columns), -1, dtype=np.int32)
    radii = np.ascontiguousarray(nodes[:, kernels.RADIUS] * scale)
    kernels.trace(np.ascontiguousarray(points), radii, starts, depth, owner)
    return depth, owner


def _shadow_map(nodes, starts, light):
    """The z-buffer seen from the light, and the ``look`` that says how to read it."""
    light = np.asarray(light, dtype=float)
    if light.shape != (3,) or not np.linalg.norm(light) > 0:
        raise InputError("light", light, "a direction (right, up, eye) other than zero")
    light = light / np.linalg.norm(light)
    aside = np.eye(3)[np.argmin(np.abs(light))]
    right = np.cross(aside, light)
    right /= np.linalg.norm(right)
    basis = np.array([right, np.cross(light, right), light])
    seen = nodes[:, :3] @ basis.T
    radii = nodes[:, kernels.RADIUS]
    low, high = seen.min(0) - radii.max(), seen.max(0) + radii.max()
    scale = min(MAP_RESOLUTION / radii.min(), FINEST_MAP, LARGEST_MAP / (high - low)[:2].max())
    low -= MAP_MARGIN / scale
    columns, rows = (int(n) for n in np.ceil((high - low)[:2] * scale) + MAP_MARGIN)
    shadow, _ = _z_buffer((seen - low) * scale, nodes, starts, rows, columns, scale)
    look = np.zeros(kernels.LOOK_WIDTH)
    look[kernels.LIGHT : kernels.LIGHT + 3] = light
    look[kernels.LIGHT_RIGHT : kernels.LIGHT_RIGHT + 3] = basis[0]
    look[kernels.LIGHT_UP : kernels.LIGHT_UP + 3] = basis[1]
    look[kernels.MAP_ORIGIN : kernels.MAP_ORIGIN + 3] = low
    look[kernels.MAP_SCALE] = scale
    return shadow, look


def draw_tubes(ax, polylines, radius, colours, view="face", *, pixel=None, window=None, **options):
    """Put :func:`render_tubes`' picture on matplotlib axes in mm; returns the AxesImage.

    Equal scales, axes labelled after the view; a view that shows no fabric axis gets a scale bar
    instead.  Arguments as for render_tubes, lengths in m.  The pixel suits the size the axes have
    now at the resolution that :func:`knitsim.figures.style.save` writes.
    """
    view = view_of(view)
    if pixel is None:
        nodes, _ = _nodes(polylines, radius, colours, view)
        box = _window(window, nodes)
        place, inches = ax.get_position(), ax.figure.get_size_inches()
        pixel = max(
            (box[1] - box[0]) / (place.width * inches[0] * DPI),
            (box[3] - box[2]) / (place.height * inches[1] * DPI),
        )
    image = render_tubes(polylines, radius, colours, view, pixel=pixel, window=window, **options)
    extent = [float(from_si(value, "mm")) for value in image.extent]
    if view.right_label and min(view.right) < 0:  # the axis runs backwards, as seen
        extent[:2] = -extent[0], -extent[1]
    shown = ax.imshow(image.rgba, extent=extent, origin="upper", aspect="equal")
    if view.right_label is None:
        ax.set_axis_off()
        _scale_bar(ax, extent)
    else:
        ax.set_xlim(extent[:2])
        ax.set_ylim(extent[2:])
        ax.set_xlabel(f"{view.right_label} (mm)")
        ax.set_ylabel(f"{view.up_label} (mm)")
    return shown


def _scale_bar(ax, extent):
    """A bar of 1, 2 or 5 times a power of ten mm, about a fifth of the picture wide, below it."""
    left, right, bottom, top = extent
    about = 0.2 * (right - left)
    power = 10.0 ** np.floor(np.log10(about))
    length = power * max(step for step in (1, 2, 5) if step * power <= about)
    y = bottom - 0.03 * (top - bottom)
    scale_bar(ax, (left, y), length, f"{length:g} mm")
    ax.set_xlim(left, right)
    ax.set_ylim(bottom - 0.06 * (top - bottom), top)
