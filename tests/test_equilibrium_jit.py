"""The kernels give the same without compilation."""

import os
import subprocess
import sys

import pytest

FABRIC = """
from knitsim.equilibrium.bend import bend
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.relax import relax
from knitsim.equilibrium.pull import tensile
from knitsim.yarn.law import paper_k3

cotton = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(True), friction=0.2,
                bending_hysteresis=1e-8)
rest = relax(cotton, Resolution(24, 160))
pulled = tensile(rest, "course", [0.02, 0.04])
found = [*pulled.force_per_loop, *pulled.dissipated, *pulled.energy[:, 3]]
bent = bend(rest, "wale", [10.0, 5.0])
found += [*bent.moment_per_width, *bent.dissipated, *bent.energy[:, 3]]
"""
# A short yarn that is pulled to and fro over a cylinder.
OPEN = """
import numpy as np
from knitsim.equilibrium.open_yarn import Cylinder, OpenYarn, Support, solve_open
from knitsim.yarn.law import TensionLaw

def over(t):
    angle = 1.2 * (t - 0.5)
    return 1e-2 * np.stack([np.sin(angle), np.cos(angle), 0.0 * t], axis=-1)

yarn = OpenYarn(1.2e-2, 1e-9, TensionLaw([0.0, 0.1], [0.0, 100.0]), 6, shape=over,
                start_force=(-0.09, -0.06, 0.0), end=Support("hinged", moved_to=(6e-3, 8.2e-3, 0.0)))
state = solve_open([yarn], cylinders=[Cylinder((0, 0, 0), (0, 0, 1), 1e-2, 1e2)], friction=0.3,
                   steps=2, coarse=True)
found = [*state.reaction(0, "end")[:2], state.lost, *state.energy]
"""


def with_and_without(script):
    """The numbers that a script finds, compiled and not."""
    found = []
    for disabled in ("0", "1"):
        run = subprocess.run(
            [sys.executable, "-c", script + "\nprint(*(repr(float(f)) for f in found))"],
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
            capture_output=True,
            text=True,
            check=True,
        )
        found.append([float(word) for word in run.stdout.split()])
    return found


@pytest.mark.slow
def test_open_yarns_with_and_without_compilation():
    compiled, plain = with_and_without(OPEN)
    assert compiled[2] > 0.0
    assert plain == pytest.approx(compiled, rel=1e-9)


@pytest.mark.slow
def test_fabrics_with_and_without_compilation():
    """With friction between the yarns and within them, pulled and bent."""
    compiled, plain = with_and_without(FABRIC)
    assert len(compiled) == 12 and min(abs(value) for value in compiled) > 0.0
    assert plain == pytest.approx(compiled, rel=1e-8)


INNER = """
import numpy as np
from knitsim.jit import njit

@njit
def squared(x):
    return x * x

@njit
def total(x):
    found = 0.0
    for i in range(x.size):
        found += squared(x[i])
    return found

{calls}
print(*found, *(sum(kernel.stats.cache_misses.values()) for kernel in (squared, total)))
"""


@pytest.mark.parametrize(
    "calls, compiled",
    [
        ("found = total(np.arange(4.0)),", [14, 1, 1]),
        ("found = total(np.arange(4.0)), squared(3.0)", [14, 9, 2, 1]),
        ("found = squared(3.0), total(np.arange(4.0))", [9, 14, 1, 1]),
    ],
)
def test_a_kernel_that_python_calls_has_a_way_in(tmp_path, calls, compiled):
    """Whether Python or another kernel calls it first; compiled now, then read from its file."""
    script = tmp_path / "kernels.py"
    script.write_text(INNER.format(calls=calls))
    for times in (compiled, [*compiled[:-2], 0, 0]):
        told = subprocess.run(
            [sys.executable, script], capture_output=True, text=True, check=True
        ).stdout
        assert [float(word) for word in told.split()] == times
