"""The checks of a study that need the models: does every yarn, loop and fabric exist."""

from knitsim.equilibrium.relax import check_start
from knitsim.measured.read import measured_test
from knitsim.stages.equilibrium import named_by_key, settings_of, solver_fabric
from knitsim.stages.laws import calibration_of, laws_of
from knitsim.stages.loop import loop_of
from knitsim.stages.yarn import layout_of


def check_study(study):
    """Build every yarn's section and laws and every fabric's loop of a Study; nothing is computed.

    A loop is built only for a fabric whose scene has a test of the kinematic model: the equilibrium
    model finds its own.  Measured curves are read.  Raises InputError for the first that cannot be.
    """
    laws = {}
    for yarn in study.yarns.values():
        layout_of(yarn)
        laws[yarn.name] = laws_of(yarn, calibration_of(yarn))["continuous"]
    for fabric in study.fabrics.values():
        for name in fabric["measured"]:
            measured_test(fabric, name)
        if fabric.scene.needs_loop:
            loop_of(fabric)
        if fabric.scene["equilibrium_rest"] is not None:
            with named_by_key(fabric):
                built = solver_fabric(fabric, laws[fabric.yarn.name])
                check_start(built, settings_of(fabric).resolution)
