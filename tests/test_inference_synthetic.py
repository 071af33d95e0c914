"""Bands against fabrics whose truth is known: solved more finely than the inference solves."""

from dataclasses import replace

import numpy as np
import pytest

from knitsim.equilibrium.contact import CoreContact
from knitsim.equilibrium.fabric import Fabric
from knitsim.inference.infer import Solved
from knitsim.inference.inputs import inputs_of
from knitsim.inference.synthetic import coverage, scored, truths
from knitsim.yarn.law import TensionLaw

pytestmark = pytest.mark.slow

FABRIC = Fabric(
    2.86e-3, 2.07e-3, 11.28e-3, 1.48e-3, 0.045e-6, TensionLaw([0.0, 0.02], [0.0, 10.0]),
    contact=CoreContact(0.65e-3, 0.0012e9, 2.4),
)  # fmt: skip
# Few, so that some dozen solved fabrics teach them: what a wale curve tells of, and friction.
UNCERTAIN = {"loop_length": 0.02, "bending_rigidity": 0.4, "core_diameter": 0.1}


def test_bands_hold_fabrics_whose_inputs_are_drawn_from_their_distribution():
    certain = dict.fromkeys(
        ("diameter", "core_stiffness", "core_exponent", "stretch", "bending_hysteresis"), 0.0
    )
    inputs = inputs_of(FABRIC, {"friction": (0.0, 0.5)}, UNCERTAIN | certain)
    inputs = tuple(i for i in inputs if i.name != "tangential_ratio")
    forces = {name: np.geomspace(20.0, 200.0, 8) for name in ("course", "wale")}
    solved = Solved(FABRIC, inputs, forces, count=32)
    emulator = solved.emulator()
    trials = [t for t in truths(solved.again, 8) if t.row is not None]
    trials = [scored(emulator, t, k) for k, t in enumerate(trials)]
    inside_50, inside_95, width, count, points = coverage(trials)
    # 8 curves whose errors go together are worth some 16 points.
    assert count >= 7 and points >= 50 and width > 0.0
    assert inside_50 > 0.25 and inside_95 > 0.8
    # A truth that the inputs cannot give is not within the band.
    course = np.array([(p.test, p.quantity) == ("course", "strain") for p in emulator.places])
    wrong = replace(trials[0], row=np.where(course, 1.5, 1.0) * trials[0].row)
    assert scored(emulator, wrong, 0).score.inside_95 < 0.5
