"""What the scenes do not need and what leaving it out saves, by computing it with and without."""

from dataclasses import replace

import numpy as np

from knitsim.benchmark.skipping import measure
from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax
from knitsim.kinematic.tension import Reading, fibre_points, tensile_test
from knitsim.stages.check import not_drawn
from knitsim.stages.equilibrium import settings_of, solver_fabric
from knitsim.stages.laws import ledger_laws
from knitsim.stages.loop import loop_of
from knitsim.stages.loop import run as run_loop
from knitsim.stages.needs import QUARTER_TOLERANCE, skips_of
from knitsim.stages.yarn import layout_of, signed_twist, simulated_yarn
from knitsim.yarn.many_sections import solve_many_sections
from knitsim.yarn.section import solve_section

COLUMNS = (
    "scene", "skipped", "because", "tests", "compared", "difference", "tolerance", "within_tolerance",
)  # fmt: skip
# Of the table beside it: what differs from run to run.
TIMES = ("scene", "skipped", "time_with_s", "time_without_s", "saved_s")

STRAINS = (0.1, 0.2, 0.4, 0.6)  # of the course tension that is solved with and without
FEW = (0.2, 0.4)  # where the other way takes long
NEARLY_NONE = 1e-12  # a coefficient of friction that changes nothing but is followed
EVERYWHERE = 1.0  # m: every pair is listed as near
SECTIONS = 2  # of the yarn solved in full
YARN_STRAIN = 0.01
SAME = 1e-6  # the solver's tolerance, of what is not a force of the equilibrium model


OF_LOOP = ("fibres", "rules not affected")  # measured on a loop that can be drawn


def run(fabrics):
    """Rows (by COLUMNS and TIMES) of the scenes of ``fabrics`` (FabricInputs), each scene measured once.

    A skip that no test of a scene makes is not measured.  Tests of the kinematic model that are left out
    because a loop cannot be drawn stand there as well, a row a fabric.
    """
    rows, first = [], {}
    for fabric in fabrics:
        if fabric.scene["equilibrium_tension"] is not None:
            first.setdefault(fabric.scene.name, fabric)
    for fabric in first.values():
        skips, resolution = skips_of(fabric.scene), settings_of(fabric).resolution
        drawn = not (fabric.scene.needs_loop and not_drawn(fabric))
        for what in dict.fromkeys(skip.what for skip in skips):
            if (what in OF_LOOP and not drawn) or (
                what == "identical sections" and not_drawn(fabric.yarn)
            ):
                continue
            own = [skip for skip in skips if skip.what == what]
            rows.append(_row(fabric.scene.name, own, MEASURES[what](fabric, resolution)))
    return rows + [row for fabric in fabrics for row in _left_out(fabric)]


def _left_out(fabric):
    """A row about the kinematic tests of a FabricInput whose loop cannot be drawn."""
    tests = [
        name
        for name in ("kinematic_tension", "kinematic_bending")
        if fabric.scene[name] is not None
    ]
    why = not_drawn(fabric) if tests else ""
    if not why:
        return []
    row = dict.fromkeys((*COLUMNS, *TIMES), "")
    told = {
        "skipped": f"kinematic tests of {fabric.name}",
        "because": why,
        "tests": "; ".join(tests),
    }
    return [row | {"scene": fabric.scene.name} | told]


def _row(scene, skips, measured):
    """One row {column: text}; skips: those of the same kind."""
    tests = {}
    for skip in skips:
        tests.setdefault(skip.test, []).append(skip.condition)
    named = [
        f"{test} ({', '.join(conditions)})" if any(conditions) else test
        for test, conditions in tests.items()
    ]
    return {
        "scene": scene, "skipped": skips[0].what, "because": skips[0].because,
        "tests": "; ".join(named), "compared": measured.compared,
        "difference": f"{measured.difference:.2e}", "tolerance": f"{measured.tolerance:g}",
        "within_tolerance": "yes" if measured.within else "no",
        "time_with_s": f"{measured.with_skip:.3g}", "time_without_s": f"{measured.without_skip:.3g}",
        "saved_s": f"{measured.saved:.3g}",
    }  # fmt: skip


def _tolerance(relaxed):
    """The solver's tolerance (N on a control point) over the largest force that is compared."""
    return relaxed.model.control.tolerance / np.abs(_force(relaxed, FEW)).max()


def _relaxed(fabric, resolution, **changes):
    """The fabric at rest without friction, but for the changes."""
    law = ledger_laws(fabric.yarn)["continuous"]
    return relax(replace(solver_fabric(fabric, law), **changes), resolution)


def _force(relaxed, strains=STRAINS, **more):
    """Force per loop along the course at the strains."""
    return tensile(relaxed, "course", strains, **more).force_per_loop


def _near(fabric, resolution):
    relaxed = _relaxed(fabric, resolution)
    model = replace(relaxed.model, control=relaxed.model.control._replace(skin=EVERYWHERE))
    every = replace(relaxed, model=model)
    return measure(
        "contact pairs never near", "force along the course", lambda: _force(relaxed, FEW),
        lambda: _force(every, FEW), _tolerance(relaxed),
    )  # fmt: skip


def _friction(fabric, resolution):
    none = _relaxed(fabric, resolution)
    hardly = _relaxed(fabric, resolution, friction=NEARLY_NONE)
    return measure(
        "friction at zero coefficient", "force along the course", lambda: _force(none),
        lambda: _force(hardly), _tolerance(none),
    )  # fmt: skip


def _pulled(fabric, resolution, **cell):
    """A function that relaxes and pulls the fabric in another cell."""
    resolution = Resolution(resolution.points, **cell)
    return lambda: _force(_relaxed(fabric, resolution), FEW)


def _whole(fabric, resolution):
    return measure(
        "full cell", "force along the course, relaxing included", _pulled(fabric, resolution),
        _pulled(fabric, resolution, cell="full"), QUARTER_TOLERANCE,
    )  # fmt: skip


def _loops(fabric, resolution):
    return measure(
        "identical loops", "force along the course, two loops in the cell, relaxing included",
        _pulled(fabric, resolution, cell="full"), _pulled(fabric, resolution, cell="full", wales=2),
        _tolerance(_relaxed(fabric, resolution)),
    )  # fmt: skip


def _sections(fabric, _):
    yarn = fabric.yarn
    law = ledger_laws(yarn)["continuous"]
    simulated = simulated_yarn(yarn, law, layout_of(yarn), "corrected")
    return measure(
        "identical sections", f"yarn tension at {100 * YARN_STRAIN:g} % strain",
        lambda: [solve_section(simulated, YARN_STRAIN).tension],
        lambda: [solve_many_sections(simulated, YARN_STRAIN, SECTIONS).tension], SAME,
    )  # fmt: skip


def _fibres(fabric, _):
    loop, laws = loop_of(fabric), ledger_laws(fabric.yarn)
    layout, twist = layout_of(fabric.yarn).positions, signed_twist(fabric.yarn)
    strains = np.linspace(0.0, 0.2, 11)

    def curve():
        return tensile_test(loop, laws["continuous"], "course", strains, Reading())

    def with_fibres():
        found = curve()
        fibre_points(loop, found, layout, twist, fabric["sections_per_loop"])
        return found.force_per_loop

    return measure(
        "fibres", "force of the kinematic model", lambda: curve().force_per_loop, with_fibres, SAME
    )


def _recovery(fabric, resolution):
    relaxed = _relaxed(fabric, resolution)

    def there():
        force = _force(relaxed)
        return np.concatenate([force, force[-2::-1], [0.0]])

    return measure(
        "recovery", "force along the course, there and back", there,
        lambda: _force(relaxed, recovery=True), _tolerance(relaxed),
    )  # fmt: skip


def _states(fabric, resolution):
    relaxed = _relaxed(fabric, resolution)
    many = STRAINS[-1] * np.arange(1, 31) / 30
    return measure(
        "states not asked for", "force along the course at the end",
        lambda: _force(relaxed, STRAINS[-1:])[-1:], lambda: _force(relaxed, many)[-1:],
        _tolerance(relaxed),
    )  # fmt: skip


def _rules(fabric, _):
    """The loop, which no setting of a test changes, made again."""

    def made():
        dataset, _ = run_loop(fabric)
        return np.concatenate(
            [dataset[name].values.ravel() for name in ("centreline", "fibre_point")]
        )

    kept = made()
    return measure("rules not affected", "loop made again", lambda: kept, made, SAME)


MEASURES = {
    "contact pairs never near": _near,
    "friction at zero coefficient": _friction,
    "full cell": _whole,
    "identical loops": _loops,
    "identical sections": _sections,
    "fibres": _fibres,
    "recovery": _recovery,
    "states not asked for": _states,
    "rules not affected": _rules,
}
