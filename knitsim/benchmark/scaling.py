"""How time and memory grow with the size of a task, and what an equilibrium test spends time on."""

import ctypes
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from knitsim.benchmark.fabric import COTTON
from knitsim.benchmark.front import cpu_time, exponent
from knitsim.benchmark.nothing import no_energy, no_pairs
from knitsim.benchmark.yarn import polyester, pull_yarn
from knitsim.equilibrium.fabric import Resolution
from knitsim.equilibrium.kernels.energy import energy_of, new_work
from knitsim.equilibrium.kernels.newton import factorise_shifted, solve_factored
from knitsim.equilibrium.kernels.pairs import pairs_at
from knitsim.equilibrium.pull import tensile
from knitsim.equilibrium.relax import relax, settle
from knitsim.errors import ComputationError, InputError

STRAINS = 0.05 * np.arange(1, 11)  # 10 states, along the course
FIXED_CONTACTS = 640
CELL = Resolution(24, 192, "full")  # as coarse as a loop can be: one of many
CELLS = ((1, 1), (2, 1), (2, 2), (4, 2), (4, 4), (8, 4), (8, 8), (10, 10), (14, 14), (20, 20))
DISTURBED = 1e-3  # relative change of the shape along and across, from which a cell is relaxed
FEW = (0.02, 0.04)  # strains along the course, of a larger cell
GROWTH = 3.0  # cost of a task is expected to grow by less than size to this power


@dataclass(frozen=True)
class Growth:
    """A task of several sizes: run(size) is timed; prepare(size), not timed, gives its argument."""

    name: str
    unit: str
    sizes: tuple
    run: Callable
    prepare: Callable = lambda size: size


@dataclass(frozen=True)
class Point:
    """One size of a Growth: seconds (CPU), memory (bytes, NaN where unknown), reason if left out."""

    size: float
    seconds: float
    memory: float
    reason: str = ""


def _trim():
    """Give freed memory back to the system, where the C library can."""
    try:
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    except (OSError, AttributeError):
        return


def _resident(key):
    """A line of /proc/self/status, in bytes."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key):
            return 1024.0 * int(line.split()[1])
    return math.nan


def peak_memory(call):
    """(result, bytes that the process held at most during ``call()`` above what it held before).

    NaN on a system that does not tell (Linux does).
    """
    try:
        _trim()
        Path("/proc/self/clear_refs").write_text("5")
        before = _resident("VmRSS")
    except OSError:
        return call(), math.nan
    result = call()
    return result, max(_resident("VmHWM") - before, 0.0)


def grow(growth, repeats=3, most=20.0):
    """(points, exponent of time, exponent of memory) of a Growth.

    A size is left out, with the reason, if it is expected to take longer than ``most`` seconds by the
    sizes before.  Exponents are fitted to the larger half of the sizes: small ones cost a constant.
    """
    points = []
    for size in growth.sizes:
        known = [p for p in points if math.isfinite(p.seconds)]
        if known:
            last = known[-1]
            slope = 1.5
            if len(known) > 1:
                slope = exponent([p.size for p in known[-2:]], [p.seconds for p in known[-2:]])
            expected = last.seconds * (size / last.size) ** min(max(slope, 1.0), GROWTH)
            if expected > most:
                reason = f"left out: expected to take {expected:.2g} s, more than {most:g} s"
                points.append(Point(size, math.nan, math.nan, reason))
                continue
        try:
            argument = growth.prepare(size)
            if not known or known[-1].seconds < 1.0:
                growth.run(argument)  # what is loaded or compiled at first is no memory of the task
            _, memory = peak_memory(partial(growth.run, argument))
            _, seconds, _ = cpu_time(partial(growth.run, argument), repeats, 1.0)
        except (InputError, ComputationError) as error:
            points.append(Point(size, math.nan, math.nan, f"failed: {error}"))
            continue
        points.append(Point(size, seconds, memory))
    done = [p for p in points if math.isfinite(p.seconds)]
    upper = done[len(done) // 2 - 1 if len(done) > 3 else 0 :]
    size = [p.size for p in upper]
    return (
        points,
        exponent(size, [p.seconds for p in upper]),
        exponent(size, [p.memory for p in upper]),
    )


def disturbed(relaxed):
    """(model, unknowns) of a cell a little wider and shorter, in shape and spacings, than at rest.

    Filled with loops at rest a larger cell would have nothing to do.
    """
    model, start = relaxed.model, relaxed.y.copy()
    for axis, factor in ((0, 1.0 + DISTURBED), (1, 1.0 - DISTURBED)):
        start[np.flatnonzero(model.cell.where[:, 2] == axis)] *= factor
        start[model.lattice + 3 * axis] *= factor
    return model, start


def relax_again(cell):
    """The Relaxed of a :func:`disturbed` cell."""
    model, start = cell
    return settle(model, start.copy(), model.free(0, 3))


def growths(full):
    """The tasks whose growth is measured; full: more and larger sizes."""
    points = (40, 56, 80, 112, 160, 224, 320) if full else (40, 80, 160)
    fibres = (1, 2, 3, 7, 19, 37, 72, 150, 330, 500) if full else (7, 37, 150)

    def pull(relaxed):
        return tensile(relaxed, "course", STRAINS)

    def loops(size):
        wales, courses = next(pair for pair in CELLS if pair[0] * pair[1] == size)
        return replace(CELL, wales=wales, courses=courses)

    tasks = [
        Growth(
            "10 states of tension, contact points fixed", "control points a loop", points, pull,
            lambda n: relax(COTTON, Resolution(n, FIXED_CONTACTS)),
        ),
        Growth(
            "10 states of tension, 4 contact points a control point", "control points a loop",
            points, pull, lambda n: relax(COTTON, Resolution(n, 4 * n)),
        ),
        Growth(
            "simulated tensile test of the yarn", "fibres", fibres,
            partial(pull_yarn, steps=20), lambda n: polyester(fibres=n),
        ),
    ]  # fmt: skip
    if full:
        sizes = tuple(wales * courses for wales, courses in CELLS)
        tasks += [
            Growth(
                "relaxing a cell disturbed by 0.1 %", "loops in the cell", sizes,
                relax_again, lambda n: disturbed(relax(COTTON, loops(n))),
            ),
            Growth(
                "2 states of tension", "loops in the cell", sizes,
                lambda relaxed: tensile(relaxed, "course", FEW), lambda n: relax(COTTON, loops(n)),
            ),
        ]  # fmt: skip
    return tasks


def phases(repeats=100, states=6):
    """What 30 states of tension cost: ({phase: CPU seconds}, seconds of all, iterations).

    One energy with gradient and Hessian (assembly), one factorisation with its solution (solve) and
    one search for contacts are timed by themselves in ``states`` of the curve's states, without the
    cost of a call from Python, and counted once an iteration, the search once a state: the least
    that Newton's method can do.  ``other`` is what the test takes beyond that: further evaluations
    and searches, checks of crossings, handling of states.
    """
    relaxed = relax(COTTON)
    strains = 0.05 * np.arange(1, 31)
    curve, total, _ = cpu_time(partial(tensile, relaxed, "course", strains), 5)
    model = relaxed.model
    scene, work, skin = model.scene, new_work(model.scene), model.control.skin
    free, two, slip = model.free(3), np.int64(2), ()

    def each(call):
        """CPU seconds of one call: a first one is not counted."""
        call()
        return cpu_time(lambda: [call() for _ in range(repeats)])[1] / repeats

    def solve():
        factorise_shifted(work.hessian, free, work.factor)
        solve_factored(work.factor, np.ones(free.size))

    search, assembly, solution = [], [], []
    for y in curve.y[np.linspace(0, curve.steps - 1, states).astype(int)]:
        pairs = pairs_at(scene, y, skin, work)
        search.append(
            each(partial(pairs_at, scene, y, skin, work))
            - each(partial(no_pairs, scene, y, skin, work))
        )
        arguments = (scene, y, pairs, slip, two, work)
        assembly.append(each(partial(energy_of, *arguments)) - each(partial(no_energy, *arguments)))
        solution.append(each(solve))
    iterations = int(curve.iterations.sum())
    spent = {
        "contact search": curve.steps * float(np.mean(search)),
        "assembly": iterations * float(np.mean(assembly)),
        "solve": iterations * float(np.mean(solution)),
    }
    spent["other"] = max(total - sum(spent.values()), 0.0)
    return spent, total, iterations
