"""Fixtures that several test modules share: the paper's cotton loop and its yarn law."""

import pytest

from knitsim.loop.build import build_loop
from knitsim.yarn.law import paper_k3

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
