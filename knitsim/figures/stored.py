"""What the figures of tests share: names, readings and stored states of a result file."""

import json
from pathlib import PurePosixPath

import numpy as np

from knitsim.errors import InputError
from knitsim.store.schema import VARIABLES

BEYOND_BREAK = VARIABLES["status"].flags.index("beyond_breaking_strain")
SMALL_POINTS = 40  # points a loop that look round where a yarn is a few pixels thick


def fabric_name(dataset):
    """Name of the yarn or fabric that a result file is about."""
    return dataset.attrs["fabric"] or dataset.attrs["yarn"]


def breaking_strain(dataset):
    """Breaking strain (1) of the yarn of a fabric's result file."""
    return json.loads(dataset.attrs["configuration"])["yarn"]["values"]["breaking_strain"]


def law_source(dataset):
    """Where the tension law of the yarn comes from, in words; a rebuilt curve is no experiment."""
    curve = json.loads(dataset.attrs["configuration"])["yarn"]["values"]["tension_curve"]
    if curve is None:
        return "Tension law of the yarn as stated in the configuration."
    file = PurePosixPath(curve["file"] or curve["files"][0])
    if curve["rebuilt"]:
        return (
            "Tension law of the yarn rebuilt from the paper's constants, not measured; the paper's"
            " measured curve of the fabric is not available."
        )
    return f"Tension law of the yarn calibrated from {file.name}."


def readings(dataset):
    """{variant: {choice: value}} of a tensile test, in the order of its variants, the reference first.

    The names of the variants are the user's own; what they stand for is in the attribute ``readings``.
    """
    found = json.loads(dataset.attrs["readings"])
    return {str(name): found[str(name)] for name in dataset.variant.values}


def with_centreline(dataset):
    """The dataset, if it holds the centre lines of its states.  Raises InputError if not."""
    if "centreline" not in dataset:
        raise InputError(
            dataset.attrs.get("title", "dataset"), "no centreline", "the scene must store it"
        )
    return dataset


def one_loop(dataset):
    """The dataset of a test of the kinematic model, with the centre line of its one loop."""
    return with_centreline(dataset).isel(loop=0)


def first_loop(state):
    """Centre line (point, 3) (m) of the first loop of a state."""
    return state.centreline.values.reshape(-1, state.sizes["point"], 3)[0]


def courses_of(state):
    """Courses in the repeating cell of a state."""
    return int(state.loop_course.max()) + 1


def loading(dataset):
    """Numbers of the states on loading."""
    return np.flatnonzero(dataset.phase.values == "loading")


def recovery(dataset):
    """Numbers of the states on recovery, with the last one of the loading before them."""
    return np.concatenate(
        [loading(dataset)[-1:], np.flatnonzero(dataset.phase.values != "loading")]
    )


def state_at(dataset, along, value):
    """Number of the stored state nearest to ``value`` of ``strain`` (on loading) or ``curvature``."""
    among = loading(dataset) if along == "strain" else np.arange(dataset.sizes["step"])
    return int(among[np.argmin(np.abs(dataset[along].values[among] - value))])


def is_beyond_break(state):
    """Whether the yarn is beyond its breaking strain in this one state."""
    return int(state.status) == BEYOND_BREAK


def with_neighbours(chosen):
    """The chosen states (n,), bool, and those beside them: their line goes on from the others'."""
    return chosen | np.append(chosen[1:], False) | np.append(False, chosen[:-1])


def thinned(state):
    """The state with about :data:`SMALL_POINTS` points of its centre line, for a small picture."""
    points = state.sizes["point"]
    stride = max(1, (points - 1) // SMALL_POINTS)
    return state.isel(point=np.unique([*range(0, points, stride), points - 1]))
