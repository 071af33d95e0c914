"""Compile the kernels of one part of the workflow, by running that part on a small study.

Two cold jobs side by side would both compile; after this one every job finds compiled kernels.
"""

from knitsim.files import cache_root, replacing
from knitsim.provenance import kernel_hash
from knitsim.store.timing import Timings

PARTS = ("yarn", "fabric", "equilibrium", "figures")


def _yarn(study):
    from knitsim.stages import yarn

    for one in study.yarns.values():
        yarn.run(one)


def _fabric(study):
    from knitsim.stages import kinematic_bending, kinematic_tension, loop
    from knitsim.stages.laws import laws_of

    for fabric in study.fabrics.values():
        loop.run(fabric)
        laws = laws_of(fabric.yarn, None)
        for direction in ("course", "wale"):
            kinematic_tension.run(fabric, laws, direction)
            kinematic_bending.run(fabric, laws, direction)


def _equilibrium(study):
    from knitsim.stages import equilibrium_bending, equilibrium_rest, equilibrium_tension
    from knitsim.stages.laws import laws_of

    for fabric in study.fabrics.values():
        laws = laws_of(fabric.yarn, None)
        equilibrium_rest.run(fabric, laws)
        equilibrium_tension.run(fabric, laws, "course")
        equilibrium_bending.run(fabric, laws, "course")


def _figures(study):
    import numpy as np

    from knitsim.figures.tubes import render_tubes

    render_tubes([np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0]])], 1e-4, "#808080", pixel=2e-5)


_RUNS = dict(zip(PARTS, (_yarn, _fabric, _equilibrium, _figures), strict=True))


def marker(part):
    """File that says, beside the compiled kernels, how long ``part`` took to compile."""
    return cache_root() / f"numba-{kernel_hash()}" / f"compiled-{part}"


def run(part, study):
    """Timings of the compilation of ``part`` (one of PARTS), by running it on a small Study.

    Where an earlier run has compiled these very kernels nothing is run: its time stands, so noted.
    """
    timings = Timings("compile", part)
    done = marker(part)
    if done.exists():
        timings.add("compilation", float(done.read_text()), note="by an earlier run")
        return timings
    from knitsim.jit import compilation_timer

    with compilation_timer() as timer:
        _RUNS[part](study)
    seconds = timer.duration if timer.done else 0.0
    with replacing(done) as partial:
        partial.write_text(f"{seconds:.6g}")
    timings.add("compilation", seconds)
    return timings
