"""The checks of a study that need the models: does every loop and every yarn exist."""

from knitsim.stages.laws import calibration_of, stated_law
from knitsim.stages.loop import loop_of
from knitsim.stages.yarn import layout_of


def check_study(study):
    """Build every yarn's section and law and every fabric's loop of a Study; nothing is computed on.

    Raises InputError for the first that cannot be.
    """
    for yarn in study.yarns.values():
        layout_of(yarn)
        stated_law(yarn)
        calibration_of(yarn)
    for fabric in study.fabrics.values():
        loop_of(fabric)
