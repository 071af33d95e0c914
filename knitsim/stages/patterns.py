"""The study of patterns: each at rest, in tension both ways, and as its calibration predicts.

The Snakefile reads the paths here, so models are imported where they run.
"""

from knitsim.store.results import DIRECTIONS, path_of
from knitsim.study.measured_checks import names_of
from knitsim.study.measured_keys import GIVEN


def calibrations_of(fabric):
    """Names of the calibrations that a FabricInput of the study is predicted with."""
    return [name for name in names_of(fabric) if name != GIVEN]


def paths(fabric):
    """Result files of a FabricInput below the root of the store, in the order of :func:`run`."""
    tension = [
        path_of("equilibrium_tension", fabric=fabric.name, direction=direction)
        for direction in DIRECTIONS
    ]
    fits = [
        path_of("calibration", fabric=fabric.name, calibration=name)
        for name in calibrations_of(fabric)
    ]
    return [path_of("equilibrium_rest", fabric=fabric.name), *tension, *fits]


def ordered(study):
    """The FabricInputs of a study, those that others may be calibrated on first."""
    return sorted(study.fabrics.values(), key=lambda fabric: fabric.calibrated_on is not None)


def run(fabrics):
    """The datasets of :func:`ordered` FabricInputs, one after the other; each fit is made once."""
    from knitsim.stages import calibration, equilibrium_rest, equilibrium_tension
    from knitsim.stages.laws import calibration_of, laws_of

    fits = {}
    for fabric in fabrics:
        laws = laws_of(fabric.yarn, calibration_of(fabric.yarn))
        yield equilibrium_rest.run(fabric, laws)[0]
        for direction in DIRECTIONS:
            yield equilibrium_tension.run(fabric, laws, direction)[0]
        for name in calibrations_of(fabric):
            yield calibration.run(fabric, laws, name, fits)[0]
