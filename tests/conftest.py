"""Fixtures that several test modules share: the paper's cotton loop and its yarn law."""

import numpy as np
import pytest
from workflow_tools import every_job, finished, project  # noqa: F401, the fixtures of the workflow

from knitsim.loop.build import build_loop
from knitsim.verification.judge.given import control_of
from knitsim.yarn.law import paper_k3


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Tests that wait for a run of the whole workflow are slow."""
    for item in items:
        if "finished" in item.fixturenames:
            item.add_marker(pytest.mark.slow)


# The cotton fabric of the paper; diameter and loop length are assumptions of the project.
COTTON = {
    "wale_spacing": 1e-2 / 6.67,
    "course_spacing": 1e-2 / 8.33,
    "diameter": 0.2793e-3,
    "loop_length": 5.56e-3,
}


@pytest.fixture(scope="session")
def cotton_loop():
    return build_loop(**COTTON)


@pytest.fixture(scope="session")
def cotton_law():
    return paper_k3(continuous=True)


@pytest.fixture(scope="session")
def rough():
    """A loop of 12 control points that touches its neighbours, and its lattice."""
    random = np.random.default_rng(3)
    u = np.arange(12) / 12
    knots = np.stack(
        [1.5e-3 * u - 0.45e-3 * np.sin(4 * np.pi * u), -8e-4 * np.cos(2 * np.pi * u),
         1.7e-4 * (1 - np.cos(4 * np.pi * u))], axis=1,
    )  # fmt: skip
    control = control_of(knots + 2e-5 * random.standard_normal((12, 3)), [1.5e-3, 0.0, 0.0])
    return control, np.array([1.5e-3, 0.0, 0.0, 1.0e-3])
