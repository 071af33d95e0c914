"""Loop length and set from a density: what went in comes out."""

from dataclasses import replace

import pytest

from knitsim.equilibrium.density import fit_density
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.relax import relax
from knitsim.yarn.law import paper_k3

COTTON = Fabric(1.4993e-3, 1.2005e-3, 5.56e-3, 0.2793e-3, 5e-9, paper_k3(continuous=True))
COARSE = Resolution(32)


def test_fit_returns_loop_length_and_set():
    # The set belongs to the loop held at the stated density, so that this must be the relaxed one.
    fabric = replace(COTTON, set_fraction=0.4)
    for _ in range(25):
        state = relax(fabric, COARSE)
        fabric = replace(
            fabric, wale_spacing=state.wale_spacing, course_spacing=state.course_spacing
        )
    fit = fit_density(replace(fabric, loop_length=5.7e-3, set_fraction=0.0), COARSE)
    assert fit.reached
    assert abs(fit.misfit).max() < 1e-4
    assert fit.relaxed.wale_spacing == pytest.approx(fabric.wale_spacing, rel=1e-4)
    assert fit.loop_length == pytest.approx(5.56e-3, rel=2e-3)


def test_a_density_out_of_reach_is_said_to_be():
    # No set makes the paper's cotton yarn, at any loop length, as wide as this at its height.
    fit = fit_density(replace(COTTON, wale_spacing=2.2e-3), COARSE)
    assert not fit.reached
    assert abs(fit.misfit).max() > 1e-3
    assert 0.0 <= fit.set_fraction <= 1.0
