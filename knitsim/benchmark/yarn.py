"""Run time against error of the simulated yarn and of the kinematic tests of the paper.

The yarn is the paper's polyester (what the paper leaves out as in the default study), the loop that
of its cotton fabric.
"""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from knitsim.benchmark.fabric import COTTON
from knitsim.benchmark.front import Setting, Task
from knitsim.kinematic.bending import bending_test, sweep
from knitsim.kinematic.tension import Reading, tensile_test
from knitsim.loop.build import build_loop
from knitsim.yarn import section
from knitsim.yarn.law import bilinear
from knitsim.yarn.many_sections import solve_many_sections
from knitsim.yarn.packing import pack

FIBRES, LINEAR_DENSITY, DENSITY, DIAMETER = 72, 33.333e-6, 1380.0, 0.2155e-3
MODULUS, SECTION_STIFFNESS, TWIST = 18.9e9, 100e6, 100.0
SPACING, STEPS, LARGEST_STRAIN = 1e-4, 100, 0.05
VELOCITY, GAUGE, VISCOUS = 0.5 / 60.0, 0.5, 10.0
PULL = {"course": 0.7, "wale": 0.4}
PULL_STEPS, BEND_STEPS, CURVATURE = 80, 50, 250.0


def polyester(spacing=SPACING, fibres=FIBRES):
    """SimulatedYarn of the paper's polyester yarn; spacing between sections (m)."""
    whole = bilinear(6.34, 2.41, 0.02, 0.08).scaled(FIBRES)
    fibre = math.sqrt(4.0 * LINEAR_DENSITY / (fibres * math.pi * DENSITY))
    return section.SimulatedYarn(
        pack(fibres, DIAMETER, fibre), whole.scaled(1.0 / fibres), spacing, TWIST,
        bending_rigidity=MODULUS * math.pi * fibre**4 / 64.0,
        section_stiffness=SECTION_STIFFNESS,
    )  # fmt: skip


def pull_yarn(yarn, steps=STEPS):
    """The yarn's tensile test, to 5 % strain and back to zero force."""
    return section.tensile_test(yarn, LARGEST_STRAIN, steps, VELOCITY, GAUGE, VISCOUS)


def yarn_errors(test, reference):
    """Errors of the curve, of the residual strain and of the work of loading.

    The curve is drawn straight between its points; its largest error on loading is over the largest
    tension.
    """

    def loading(one):
        last = int(one.loading.sum())
        return one.strain[:last], one.tension[:last], one.work[last - 1]

    (strain, tension, work), (at, exact, all_work) = loading(test), loading(reference)
    return (
        np.abs(np.interp(at, strain, tension) - exact).max() / exact.max(),
        abs(test.residual_strain / reference.residual_strain - 1.0),
        abs(work / all_work - 1.0),
    )


def tension_errors(state, reference):
    """(relative error of the tension,)."""
    return (abs(state.tension / reference.tension - 1.0),)


def yarn_tasks(full):
    """The yarn's tensile test, and one of its states by one section and by many."""
    spacings = (2e-4, SPACING, 5e-5, 1.25e-5) if full else (2e-4, SPACING, 5e-5)
    steps = (20, 50, STEPS, 200) if full else (20, STEPS)
    pairs = [(SPACING, n) for n in steps] + [(s, STEPS) for s in spacings if s != SPACING]
    test = Task(
        "yarn", "tensile test", ("curve", "residual strain", "work"),
        tuple(
            Setting(
                f"sections {1e3 * spacing:g} mm apart, {n} steps",
                partial(pull_yarn, polyester(spacing), n),
                (spacing, n) == (SPACING, STEPS),
            )
            for spacing, n in pairs
        ),
        partial(pull_yarn, polyester(SPACING / 16.0), 1000 if full else 400),
        partial(pull_yarn, polyester(SPACING / 8.0), 500 if full else 200),
        yarn_errors,
    )  # fmt: skip
    one = partial(section.solve_section, strain=LARGEST_STRAIN)
    state = Task(
        "yarn", "one state", ("tension",),
        (
            Setting("one section", partial(one, polyester()), True),
            *(
                Setting(
                    f"{n} sections",
                    partial(solve_many_sections, polyester(), LARGEST_STRAIN, n),
                )
                for n in ((2, 4, 8, 16) if full else (2, 4))
            ),
        ),
        partial(one, polyester(SPACING / 16.0)), partial(one, polyester(SPACING / 8.0)),
        tension_errors,
    )  # fmt: skip
    return [test, state]


@dataclass(frozen=True)
class _Quadrature:
    """A PeriodicSpline as the kinematic tests see it, with Gauss points of another number."""

    spline: object
    nodes: np.ndarray
    weights: np.ndarray

    def points(self, u):
        return self.spline.points(u)

    def derivative(self, u, order=1):
        return self.spline.derivative(u, order)


def with_gauss_points(loop, count):
    """The loop with ``count`` Gauss points between any two knots of its centre line."""
    knots = loop.spline.knots
    x, weight = np.polynomial.legendre.leggauss(count)
    half = 0.5 * np.diff(knots)[:, None]
    middle = 0.5 * (knots[1:] + knots[:-1])[:, None]
    quadrature = _Quadrature(loop.spline, (middle + half * x).ravel(), (half * weight).ravel())
    return replace(loop, spline=quadrature)


def force_errors(curve, reference):
    """(largest error of the force over that force, or 1 % of the largest,)."""
    size = np.maximum(reference.force_per_loop, 0.01 * reference.force_per_loop.max())
    return (np.abs((curve.force_per_loop - reference.force_per_loop) / size).max(),)


def moment_errors(curve, reference):
    """(largest error of the moment over the largest moment,)."""
    moment = reference.moment_per_width
    return (np.abs(curve.moment_per_width - moment).max() / np.abs(moment).max(),)


def kinematic_tasks(full):
    """The paper's tests, by the Gauss points that measure the yarn's length."""
    loop = build_loop(
        COTTON.wale_spacing, COTTON.course_spacing, COTTON.diameter, COTTON.loop_length
    )
    own = loop.nodes.size // (loop.spline.knots.size - 1)
    counts = sorted({own, *((1, 2, 3, 4, 6, 8, 12, 16) if full else (2, 4, 8))})

    def task(test, quantity, run, errors):
        settings = tuple(
            Setting(f"{n} Gauss points a piece", partial(run, with_gauss_points(loop, n)), n == own)
            for n in counts
        )
        finest, half = (partial(run, with_gauss_points(loop, n * own)) for n in (4, 2))
        return Task("kinematic", test, (quantity,), settings, finest, half, errors)

    def pull(direction, loop):
        strains = PULL[direction] * np.arange(PULL_STEPS + 1) / PULL_STEPS
        return tensile_test(loop, COTTON.law, direction, strains, Reading())

    def bent(direction, loop):
        return bending_test(loop, COTTON.law, direction, *sweep(CURVATURE, BEND_STEPS))

    return [
        *(task(f"{d} tension", "force", partial(pull, d), force_errors) for d in PULL),
        *(task(f"{d} bending", "moment", partial(bent, d), moment_errors) for d in PULL),
    ]
