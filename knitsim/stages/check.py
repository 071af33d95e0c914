"""The checks of a study that need the models: does every yarn, loop and fabric exist."""

import sys

from knitsim.equilibrium.relax import check_start
from knitsim.errors import InputError
from knitsim.measured.read import measured_test
from knitsim.stages.equilibrium import named_by_key, settings_of, solver_fabric
from knitsim.stages.laws import calibration_of, laws_of
from knitsim.stages.loop import loop_of
from knitsim.stages.yarn import layout_of


def check_study(study):
    """Build every yarn's laws and section and every fabric's loop of a Study; nothing is computed.

    No model gates another: what cannot be built is said, and its tests are left out when the study is
    run, unless nothing else of the fabric is tested.  Measured curves are read.  Raises InputError for the
    first fabric that has no test left, and for what no model can use.
    """
    laws = {}
    for yarn in study.yarns.values():
        laws[yarn.name] = laws_of(yarn, calibration_of(yarn))["continuous"]
        why = not_drawn(yarn)
        if why:
            _say(f"the yarn {yarn.name} is not simulated", why)
    for fabric in study.fabrics.values():
        for name in fabric["measured"]:
            measured_test(fabric, name)
        solved = fabric.scene["equilibrium_rest"] is not None
        if fabric.scene.needs_loop:
            try:
                loop_of(fabric)
                layout_of(fabric.yarn)
            except InputError as error:
                if not solved:
                    raise
                _say(f"fabric {fabric.name}: the kinematic tests are left out", error)
        if solved:
            law = laws[fabric.yarn.name]
            with named_by_key(fabric, law):
                built = solver_fabric(fabric, law)
                check_start(built, settings_of(fabric).resolution)


def not_drawn(subject):
    """Why the loop of a FabricInput, or the fibres of a YarnInput, cannot be drawn; empty where they can."""
    try:
        if hasattr(subject, "yarn"):
            loop_of(subject)
        layout_of(getattr(subject, "yarn", subject))
    except InputError as error:
        return str(error)
    return ""


def _say(what, why):
    print(f"knitsim: {what}: {why}", file=sys.stderr, flush=True)
