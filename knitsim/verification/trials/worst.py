"""Worst cases: ranges well beyond those of :mod:`.law`, and families that make one thing hard.

Bending rigidity over six decades and none, stiffness over four, friction to 1, strain asked in one
jump, coarse grids, loops that hardly close, tight and open fabrics, each pulled, bent or sheared.
"""

import math
from dataclasses import replace

import numpy as np

from knitsim.verification.trials.law import NO_INPUT, PAIR, PEIRCE, POINTS, Asked, Law, cycle
from knitsim.verification.trials.rule import NARROW, contact_spacing, slender

RANGES = {
    "diameter": (0.05e-3, 1e-3, "log"),
    "loop_over_diameter": (12.5, 60.0, "log"),
    "kw": (2.6, 4.8, ""),
    "kc": (4.0, 7.0, ""),
    "stiffness": (1e7, 1e11, "log"),
    "bending": (1e-6, 1.0, "log"),
    "compression": (1e-3, 1.0, "log"),
    "friction": (0.0, 1.0, ""),
    "exponent": (1.2, 6.0, ""),
    "course_strain": (0.05, 1.2, ""),
    "wale_strain": (0.05, 0.8, ""),
}  # fmt: skip
SHARES = {
    "frictionless": 0.4, "core": 0.1, "set": 0.1, "hysteresis": 0.1, "full": 0.03, "several": 0.01,
    "held": 0.2, "fine": 0.1,
}  # fmt: skip
FAMILIES = {
    "any": {},
    "limp": {"bending": (1e-6, 1e-4, "log")},
    "rigid": {"bending": (0.3, 1.0, "log"), "compression": (1e-3, 1e-2, "log")},
    "stiff": {"stiffness": (1e10, 1e11, "log"), "compression": (0.1, 1.0, "log")},
    "rough": {"friction": (0.8, 1.0, "")},
    "jump": {"course_strain": (0.5, 0.8, ""), "wale_strain": (0.4, 0.6, "")},
    "coarse": {},
    "tight": {"loop_over_diameter": (12.0, 14.0, ""), "kw": (3.4, 4.0, ""), "kc": (5.0, 7.0, "")},
    "open": {"loop_over_diameter": (40.0, 80.0, "")},
    "degenerate": {},
    "bent": {"curvature": (500.0, 2000.0, "log")},
    NO_INPUT: {},
}  # fmt: skip
SHEAR, BENDING = 0.08, 0.37  # parts of the cases; the others are pulled
LEVELS = (1, 2, 4)  # strains or curvatures asked
INCREMENTS = (0.1, 0.5)  # of strain in one solved step, asked of rough jumps
REFINED = 10  # one case in so many is solved again at twice the resolution
SHORT = 0.3  # of the strains of fabrics with thousands of contact points


def _one_test(case, value, random):
    """The case made as hard as its family is, with its one test."""
    family, d = case.family, case.hard
    jump, has = family == "jump", value["has"]
    part = random.random()
    kind = "shear" if part < SHEAR else "bending" if part < SHEAR + BENDING else "tension"
    if family in ("jump", "bent"):
        kind = "tension" if jump else "bending"
    direction = ("course", "wale")[random.integers(2)]
    if family == "rough" and case.friction == 0.0:
        case = replace(case, friction=value["friction"])
    levels = 1 if jump else int(random.choice(LEVELS))
    # Back from a jump there is no state to go through.
    cycles = int(has["recovers"] and not jump)
    increment = float(random.choice(INCREMENTS)) if jump and case.friction > 0.0 else None
    if family == "coarse":
        case = replace(case, points=int(random.choice((12, 20, 24, 26, 28, 32, 40))))
        if random.random() < 0.5:
            # Contact points up to four times as far apart as the contact needs.
            spacing = contact_spacing(case) * random.uniform(1.0, 4.0)
            case = replace(case, contacts=4 * max(1, round(case.loop_length / spacing / 4.0)))
    if family == "degenerate":
        # Peirce's loop, l = 2 c + w + 5.94 d, the yarn pressed to 0.7 d .. d: it hardly reaches its
        # neighbours, or has hardly room for its yarns.
        rest = case.loop_length - PEIRCE * random.uniform(0.7, 1.0) * d
        share = random.uniform(0.2, 0.6)  # of the rest that is taken by the wale spacing
        case = replace(case, wale_spacing=rest * share, course_spacing=0.5 * rest * (1.0 - share))
    refined, strain = bool(random.integers(REFINED) == 0), value[f"{direction}_strain"]
    if slender(case) < NARROW:
        # Solved with thousands of contact points: a short test.
        levels, cycles, refined, strain = 1, 0, False, SHORT * strain
        case = replace(case, points=min(case.points, POINTS))
    if kind == "shear":
        case = replace(case, cell="full")
        path = cycle(math.radians(value["angle"]), levels)[1:].tolist()
        test = Asked(kind, "", tuple(path), "held" if has["held"] else "free")
    else:
        largest = value["sign"] * value["curvature"] if kind == "bending" else strain
        path = pairs(largest, levels, jump)
        if kind == "bending":
            path = [0.0, *path]
            path += [(1.0 - PAIR) * largest, 0.0, -largest] if cycles else []
            cycles = 0
        lateral = "held" if has["held"] else "free"
        test = Asked(kind, direction, tuple(path), lateral, 0.0, cycles, increment)
    if family == NO_INPUT:
        case = replace(case, **_no_input(case, random))
    return replace(case, refined=refined, tests=(test,))


def pairs(largest, levels, jump=False):
    """Strains or curvatures on the way out: pairs close together, the last at the largest.

    Except in a jump another state comes first, close to the start, where friction sets in.
    """
    ends = largest * np.arange(1, levels + 1) / levels
    path = np.stack([ends - PAIR * largest, ends], axis=1).ravel().tolist()
    return path if jump else [PAIR * largest, *path]


def _no_input(case, random):
    """One input that no fabric has."""
    wrong = (
        {"bending_rigidity": 0.0},
        {"bending_rigidity": -case.bending_rigidity},
        {"friction": 1.0 + random.uniform(0.1, 2.0)},
        {"friction": -0.1},
        {"diameter": 0.0},
        {"diameter": case.loop_length / random.uniform(2.0, 3.9)},
        {"loop_length": math.nan},
        {"wale_spacing": math.inf},
        {"course_spacing": -case.course_spacing},
        {"contact": replace(case.contact, stiffness=0.0)},
        {"set_fraction": 1.2},
        {"bending_hysteresis": -1e-9},
    )
    return wrong[random.integers(len(wrong))]


WORST = Law(_one_test, RANGES, SHARES, FAMILIES, any=0.4)
