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
    """Timings of ``part`` (one of PARTS) on a small Study: the first run, and what of it was set-up.

    Set-up is compilation, or loading compiled kernels where an earlier run has left them.
    """
    from knitsim.jit import CACHE_DIR

    timings = Timings("compile", part)
    before = _compiled(CACHE_DIR)
    seconds = []
    for _ in range(2):
        start = time.perf_counter()
        _RUNS[part](study)
        seconds.append(time.perf_counter() - start)
    note = f"{_compiled(CACHE_DIR) - before} kernels compiled, the others loaded"
    timings.add("set-up of the kernels", seconds[0] - seconds[1], note=note)
    return timings
