"""Checks that need more than one key of a yarn or fabric, and no heavy import."""

import itertools
import math

from knitsim.equilibrium.contact import LAWS
from knitsim.equilibrium.pattern import Pattern
from knitsim.errors import InputError
from knitsim.study.schema import STAGES, closure
from knitsim.units import from_si

# Fibre points turn with the section: beyond these a chord no longer stands for its fibre.
LARGEST_TURN = 45.0  # degrees from section to section
LARGEST_SURFACE_ANGLE = 60.0  # degrees, of the outermost fibre to the yarn axis
# Of the largest curvature times half the thickness, which is at least one diameter: two yarns cross.
TIGHTEST_BEND = 0.5
ROUNDED = 0.02  # of a stated diameter
MOST_WALES = 1.05  # times the courses: beyond, they are taken to be exchanged
LOOPS = (
    17.0,
    27.0,
)  # wales times courses times the square of the loop length, dry to fully relaxed jersey
SHORTEST = 6.5  # loop length over diameter: a yarn that is pressed to 0.4 of its diameter
TIGHTEST = 11.0  # the same, of the tightest fabrics that are knitted
DENSEST_PACKING = math.pi / math.sqrt(12.0)  # hexagonal, of equal circles


def surface_angle(yarn):
    """Angle (degrees) of the yarn's surface to its axis: tan = pi diameter twist."""
    return math.degrees(math.atan(math.pi * yarn["diameter"] * yarn["twist"]))


def check_yarn(yarn):
    """Raises InputError if the keys of ``yarn`` (a YarnInput) contradict each other."""
    _check_law(yarn)
    _check_diameter(yarn)
    _check_contact(yarn)
    if surface_angle(yarn) > LARGEST_SURFACE_ANGLE:
        most = math.tan(math.radians(LARGEST_SURFACE_ANGLE)) / (math.pi * yarn["diameter"])
        raise InputError(
            *yarn.stated("twist"),
            f"must be at most {most:.4g} turns per m at diameter {yarn['diameter'] * 1e3:.4g} mm: "
            f"no section spacing resolves a surface angle of {surface_angle(yarn):.3g} degrees",
        )
    turn = 360.0 * yarn["twist"] * yarn["section_spacing"]
    if turn > LARGEST_TURN * (1.0 + 1e-12):
        most = LARGEST_TURN / 360.0 / yarn["twist"]
        raise InputError(
            *yarn.stated("section_spacing"),
            f"must be at most {most * 1e3:.4g} mm: the twist turns {turn:.3g} degrees per section, "
            f"and more than {LARGEST_TURN:g} is not resolved",
        )


def _check_diameter(yarn):
    one = yarn["fibres"] == 1
    densest = 1.0 if one else DENSEST_PACKING
    solid = math.sqrt(4.0 * yarn["linear_density"] / (math.pi * yarn["density"]))
    least = solid / math.sqrt(densest)
    if yarn["diameter"] * (1.0 + ROUNDED) >= least:
        return
    if not yarn.is_stated("diameter"):
        raise InputError(
            *yarn.stated("packing"), f"must be at most {densest:.4g}, that of parallel round fibres"
        )
    raise InputError(
        *yarn.stated("diameter"),
        f"must be at least {least * 1e3:.4g} mm: the fibres alone fill that much at density "
        f"{yarn['density'] / 1e3:.4g} g/cm3",
    )


def _check_contact(yarn):
    """Raises InputError for more than one contact law, or for one that the yarn has no room for."""
    stated = [section for section in LAWS if yarn[section] is not None]
    given = [*stated, *(["compression_curve"] if yarn["compression_curve"] is not None else [])]
    if len(given) > 1:
        raise InputError(
            yarn.where(given[1]), None, f"gives the same law as {given[0]}; keep one of them"
        )
    for section in stated:
        for name, q in LAWS[section].quantities().items():
            if q.length and not yarn[section][name] < yarn["diameter"]:
                raise InputError(
                    *yarn.stated(f"{section}.{name}"),
                    f"must be below the yarn's diameter, {yarn['diameter'] * 1e3:.4g} mm",
                )


def _check_law(yarn):
    law, curve = yarn["tension_law"], yarn["tension_curve"]
    if yarn["modulus"] is not None and (law or curve):
        raise InputError(
            *yarn.stated("modulus"),
            f"gives the same law as {'tension_law' if law else 'tension_curve'}; keep one of them",
        )
    if law is None:
        return
    if law["kind"] == "secant":
        if not law["high"] > law["low"]:
            raise InputError(
                *yarn.stated("tension_law.high"),
                f"must be above low_N = {law['low']:g}: the line above the switch is steeper",
            )
        start, name = (
            max(law["switch_strain"], law["offset"] / (law["high"] - law["low"])),
            "switch",
        )
    elif law["kind"] == "bilinear":
        start, name = law["yield_strain"], "yield"
    else:
        _check_points(yarn, law)
        return
    if not yarn["breaking_strain"] > start:
        raise InputError(
            *yarn.stated("breaking_strain"),
            f"must be above the {name} strain of the law, {start:g}",
        )


def _check_points(yarn, law):
    strain, tension = law["strain"], law["tension"]
    if len(strain) != len(tension) or len(strain) < 2:
        raise InputError(
            yarn.where("tension_law.tension_N"),
            f"{len(tension)} values",
            f"must be as many as the strains ({len(strain)}), two or more",
        )
    for name, values in (("strain", strain), ("tension_N", tension)):
        if values[0] != 0:
            raise InputError(yarn.where(f"tension_law.{name}[0]"), values[0], "must be 0")
        for i, (before, value) in enumerate(itertools.pairwise(values), 1):
            if value < before:
                raise InputError(
                    yarn.where(f"tension_law.{name}[{i}]"), value, f"must not fall below {before:g}"
                )


def check_scene(scene, stated):
    """Raises InputError if the sections of ``scene`` (a SceneInput) contradict each other.

    stated: what the file states, by section and key.
    """
    rest = stated.get("equilibrium_rest")
    if rest is None:
        for test in stated:
            if test in STAGES and "equilibrium_rest" in closure(test):
                raise InputError(
                    scene.where("equilibrium_rest"), None,
                    f"is missing; {test} starts from it ({{}} takes every default)",
                )  # fmt: skip
        return
    if "accuracy" in rest and "points" in rest:
        raise InputError(
            *scene.stated("equilibrium_rest.accuracy"),
            "chooses what points states; keep one of them",
        )


def check_fabric(fabric):
    """Raises InputError if the yarn of ``fabric`` (a FabricInput) is too thick for its spacings, or it has
    other courses than its pattern.
    """
    _check_loop_length(fabric)
    diameter, pattern = fabric.yarn["diameter"], Pattern.of(fabric["pattern"])
    ratios = fabric["course_length_ratios"]
    if ratios is not None and len(ratios) != pattern.courses:
        raise InputError(
            fabric.where("course_length_ratios"), ratios,
            f"must be one for each of the {pattern.courses} courses of pattern {pattern}",
        )  # fmt: skip
    for quantity, what in (("wale_spacing", "wale"), ("course_spacing", "course")):
        if fabric.is_stated(quantity) and fabric[quantity] <= diameter:
            raise InputError(
                *fabric.stated(quantity),
                f"is a {what} spacing of {fabric[quantity] * 1e3:.4g} mm: must be above "
                f"the {diameter * 1e3:.4g} mm of its yarn (yarn too thick)",
            )
    rest = fabric.scene["equilibrium_rest"]
    if fabric["pattern"] == "jersey":
        _check_density(fabric)
    elif rest is not None and rest["fit_density"] and not fabric.is_stated("wale_spacing"):
        raise InputError(
            fabric.scene.where("equilibrium_rest.fit_density"), "true",
            f"needs the density of fabric {fabric.name} (wales_per_cm, courses_per_cm)",
        )  # fmt: skip
    _check_room(fabric)
    _check_curvature(fabric, diameter)


def _check_loop_length(fabric):
    given = [q for q in ("loop_length", "tightness_factor", "mass_per_area")
             if fabric.is_stated(q) and q not in fabric.derived]  # fmt: skip
    if len(given) > 1:
        first = fabric.stated(given[0])[0].rsplit(".", 1)[-1]
        raise InputError(
            *fabric.stated(given[1]), f"gives the same quantity as {first}; keep one of them"
        )


def _check_density(fabric):
    w, c = fabric["wale_spacing"], fabric["course_spacing"]
    if fabric["density_checked"] or not fabric.is_stated("wale_spacing"):
        return
    wales, courses = 1e-2 / w, 1e-2 / c
    if fabric.is_stated("course_spacing"):
        _check_loops(fabric, wales, courses)
    if c <= MOST_WALES * w:
        return
    raise InputError(
        *fabric.stated("wale_spacing"),
        f"{wales:.4g} wales and {courses:.4g} courses per cm: are they exchanged? A plain fabric has more "
        f"courses than wales; state {courses:.4g} wales and {wales:.4g} courses per cm, or "
        "density_checked: true if this is meant",
    )


def _check_loops(fabric, wales, courses):
    """Raises InputError for loops that fit the density (per cm) of a plain fabric in another unit only."""
    loop = from_si(fabric["loop_length"], "mm")
    found = wales * courses * loop**2 / 100.0
    if LOOPS[0] / 3.0 <= found <= LOOPS[1] * 3.0:
        return
    inch = f"wales_per_inch: {wales:.4g}, courses_per_inch: {courses:.4g}"
    derived = "loop_length" in fabric.derived
    # Of a loop that mass and density give, the density counts twice.
    by_mass = derived and fabric.is_stated("mass_per_area")
    of_loop = (
        (f"loop_length_mm: {10.0 * loop:.4g}", 100.0),
        (f"loop_length_mm: {0.1 * loop:.4g}", 0.01),
        (f"loop_length_mm: {25.4 * loop:.4g}", 25.4**2),
    )
    for meant, by in (*(() if derived else of_loop), (inch, 2.54 ** (2 if by_mass else -2))):
        if LOOPS[0] / 1.5 <= found * by <= LOOPS[1] * 1.5:
            raise InputError(
                *fabric.stated("wale_spacing" if meant == inch else "loop_length"),
                f"with {wales:.4g} wales and {courses:.4g} courses per cm and a loop of {loop:.4g} mm makes "
                f"kc kw {found:.3g}, and plain fabrics have {LOOPS[0]:g} to {LOOPS[1]:g}: is {meant} meant? "
                "Else state density_checked: true",
            )


def _check_room(fabric):
    """Raises InputError for a loop that no needle could have drawn of such a yarn."""
    diameter, loop = fabric.yarn["diameter"], fabric["loop_length"]
    if loop >= SHORTEST * diameter or fabric["density_checked"]:
        return
    raise InputError(
        *fabric.stated("loop_length"),
        f"is {loop / diameter:.3g} diameters of its yarn ({1e3 * diameter:.3g} mm), tightness factor "
        f"{fabric.tightness_factor:.3g}: the loops of the tightest fabrics are {TIGHTEST:g}, here "
        f"{1e3 * TIGHTEST * diameter:.3g} mm. Is the loop length that of one stitch, and the count right? "
        "Else state density_checked: true",
    )


def _check_curvature(fabric, diameter):
    """Raises InputError for a bending test on a cylinder that is smaller than the yarn allows."""
    test = fabric.scene["equilibrium_bending"]
    if test is None:
        return
    for name, choice in test["variants"].items():
        if choice["max_curvature"] * diameter > TIGHTEST_BEND:
            most = from_si(TIGHTEST_BEND / diameter, "per_cm")
            key = f"equilibrium_bending.variants.{name}.max_curvature_per_cm"
            raise InputError(
                fabric.scene.where(key),
                f"{from_si(choice['max_curvature'], 'per_cm'):g}",
                f"must be at most {most:.4g} per cm for fabric {fabric.name}: the cylinder is smaller "
                f"than its yarn of {diameter * 1e3:.4g} mm allows",
            )
