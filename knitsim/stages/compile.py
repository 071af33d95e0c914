"""Compile the kernels of one part of the workflow, by running that part on a small study.

Two cold jobs side by side would both compile; after this one every job finds compiled kernels.
"""

import time

import numpy as np

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
    from knitsim.stages import equilibrium_rest, equilibrium_tension
    from knitsim.stages.laws import laws_of

    for fabric in study.fabrics.values():
        laws = laws_of(fabric.yarn, None)
        equilibrium_rest.run(fabric, laws)
        equilibrium_tension.run(fabric, laws, "course")


def _figures(study):
    from knitsim.figures.tubes import render_tubes

    render_tubes([np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0]])], 1e-4, "#808080", pixel=2e-5)


_RUNS = dict(zip(PARTS, (_yarn, _fabric, _equilibrium, _figures), strict=True))


def _compiled(cache):
    """Number of compiled kernels in the cache directory."""
    return len(list(cache.rglob("*.nbc")))


def run(part, study):
    """Timings of ``part`` (one of PARTS) on a small Study: compilation, told apart from the run itself.

    Where an earlier run has left compiled kernels, the time to load them with one run.
    """
    from knitsim.jit import CACHE_DIR

    timings = Timings("compile", part)
    before = _compiled(CACHE_DIR)
    start = time.perf_counter()
    _RUNS[part](study)
    first = time.perf_counter() - start
    compiled = _compiled(CACHE_DIR) - before
    if not compiled:
        timings.add("loading the kernels, and one small run", first, note="none compiled")
        return timings
    start = time.perf_counter()
    _RUNS[part](study)
    second = time.perf_counter() - start
    timings.add("compilation", first - second, note=f"{compiled} kernels")
    return timings
