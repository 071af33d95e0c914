"""The kernels give the same without compilation."""

import os
import subprocess
import sys

import pytest

SCRIPT = """
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.relax import relax
from knitsim.equilibrium.pull import tensile
from knitsim.yarn.law import paper_k3

cotton = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(True), friction=0.2)
curve = tensile(relax(cotton, Resolution(24, 160)), "course", [0.02, 0.04])
print(*(repr(float(f)) for f in (*curve.force_per_loop, *curve.dissipated)))
"""


@pytest.mark.slow
def test_with_and_without_compilation():
    found = []
    for disabled in ("0", "1"):
        run = subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
            capture_output=True,
            text=True,
            check=True,
        )
        found.append([float(word) for word in run.stdout.split()])
    assert len(found[0]) == 4
    assert min(found[0]) > 0.0
    assert found[1] == pytest.approx(found[0], rel=1e-9)
