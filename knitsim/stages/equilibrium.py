"""What the equilibrium stages share: a fabric's input as the solver wants it, states as a dataset."""

import pickle
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from knitsim.equilibrium.contact import BarrierContact
from knitsim.equilibrium.fabric import Fabric, Resolution
from knitsim.equilibrium.model import rubbing
from knitsim.equilibrium.relax import REASONS, TOO_CLOSE, relax
from knitsim.errors import ComputationError, InputError
from knitsim.measured.read import read_entry
from knitsim.stages.laws import ledger_laws
from knitsim.stages.ledger import effect_dataset
from knitsim.stages.memory import history_json, with_history
from knitsim.stages.remedy import ROOM, remedies
from knitsim.store.tensile import stack_variants
from knitsim.store.writer import to_json
from knitsim.study.contact_keys import stated_contact
from knitsim.study.schema import closure
from knitsim.yarn.compression import fit_barrier_test

_rests, KEPT_RESTS = {}, 64  # at most, of a job
FOLLOWED = 112  # control points of a loop that resolve the effect of an assumption


def contact_of(yarn):
    """Contact law of a YarnInput: a core law, a calibrated stiffness or the stated one."""
    if (stated := stated_contact(yarn)) is not None:
        return stated
    if (test := compressed(yarn)) is not None:
        return BarrierContact(fit_barrier_test(test, yarn["diameter"]).stiffness)
    return BarrierContact(yarn["compression_stiffness"])


def compressed(yarn):
    """The MeasuredTest of a YarnInput's compression curve, or None."""
    if yarn["compression_curve"] is None:
        return None
    return read_entry(yarn["compression_curve"], yarn.compression_paths, "yarn_compression")


def solver_fabric(fabric, law, *, friction=False, set_fraction=None, loop_length=None):
    """knitsim.equilibrium Fabric of a FabricInput; law: TensionLaw of its yarn.

    set_fraction, loop_length: instead of the stated ones.
    """
    yarn = fabric.yarn
    return Fabric(
        fabric["wale_spacing"], fabric["course_spacing"],
        fabric["loop_length"] if loop_length is None else loop_length,
        yarn["diameter"], yarn["bending_rigidity"], law,
        contact=contact_of(yarn),
        friction=yarn["friction"] if friction else 0.0,
        set_fraction=fabric["set"] if set_fraction is None else set_fraction,
        bending_hysteresis=yarn["bending_hysteresis"] if friction else 0.0,
        tangential_ratio=yarn["tangential_ratio"], stuck_ratio=yarn["stuck_ratio"],
        pattern=fabric["pattern"], course_lengths=tuple(fabric["course_length_ratios"] or ()),
    )  # fmt: skip


@contextmanager
def named_by_key(fabric, law=None):
    """Refusals of the solver about a quantity of a FabricInput name the key that states it.

    law: TensionLaw of its yarn; with it a yarn that has no room in its loop is told what would have.
    """
    try:
        yield
    except InputError as error:
        quantity = error.where.replace(" ", "_")
        if quantity == "diameter" and not fabric.yarn.is_stated(quantity):
            # What somebody wrote.
            stated = ("tightness_factor", "mass_per_area")
            quantity = next((one for one in stated if fabric.is_stated(one)), "loop_length")
        given = next((one for one in (fabric, fabric.yarn) if quantity in one.values), None)
        if given is None:
            raise
        right = error.right if given is fabric else f"fabric {fabric.name}: {error.right}"
        if law is not None and error.where in ROOM:
            right += f"; {remedies(fabric, lambda changed: solver_fabric(changed, law))}"
        raise InputError(*given.stated(quantity), right) from error
    except ComputationError as error:
        if law is None or REASONS[TOO_CLOSE] not in str(error):
            raise
        cure = remedies(fabric, lambda changed: solver_fabric(changed, law))
        raise ComputationError(f"{error}: a short loop for so thick a yarn; {cure}") from error


@dataclass(frozen=True)
class Settings:
    """How finely the equilibrium tests of a fabric are solved: at a resolution, or to an accuracy."""

    resolution: Resolution
    accuracy: float | None = None

    @property
    def errors(self):
        """Arguments of a test that make it estimate its errors, or reach the accuracy."""
        return {"estimate_error": True} if self.accuracy is None else {"accuracy": self.accuracy}

    @property
    def stated(self):
        """The resolution where the scene states its points, None where it asks for an accuracy."""
        return self.resolution if self.accuracy is None else None

    @property
    def fixed(self):
        """As plain data, of results that are solved at the resolution alone, whatever the accuracy."""
        return {"accuracy": None, "points": self.resolution.points}

    def told(self, solved):
        """As plain data: what was asked for, and what each of the solved states or curves took, by name."""
        return {"accuracy": self.accuracy} | {name: _taken(one) for name, one in solved.items()}


def _taken(solved):
    cell = solved.model.cell
    taken = {"points": cell.points, "contacts": cell.contacts}
    increment = getattr(solved, "increment", np.nan)
    return taken | ({} if np.isnan(increment) else {"increment": increment})


def settings_of(fabric):
    """The :class:`Settings` that the scene of a FabricInput asks for."""
    test = fabric.scene["equilibrium_rest"]
    points, accuracy = test["points"], test["accuracy"]
    resolution = (
        Resolution(cell=test["cell"]) if points is None else Resolution(points, cell=test["cell"])
    )
    return Settings(resolution, accuracy if points is None else None)


def at_rest(fabric, law, resolution, **options):
    """A FabricInput at rest, with friction after its history; law, options: as :func:`solver_fabric`
    takes them."""
    with named_by_key(fabric, law):
        return with_history(fabric, _relaxed(solver_fabric(fabric, law, **options), resolution))


def _relaxed(fabric, resolution):
    """relax(fabric, resolution), once: the tests of a fabric, and what they follow of its assumptions, begin
    from the same few states."""
    same = pickle.dumps((fabric, resolution))
    if same not in _rests:
        if len(_rests) >= KEPT_RESTS:
            _rests.clear()
        smooth = replace(fabric, friction=0.0, bending_hysteresis=0.0)
        if fabric.set_fraction or (fabric.friction, fabric.bending_hysteresis) == (0.0, 0.0):
            _rests[same] = relax(fabric, resolution)
        else:
            _rests[same] = rubbing(_relaxed(smooth, resolution), fabric)
    return _rests[same]


def at_rest_again(fabric, resolution, **options):
    """A FabricInput at rest without a calibration, for the effect of an assumption.

    resolution: that of the result whose change is sought, so that the effect is not that of other points.
    """
    return at_rest(fabric, ledger_laws(fabric.yarn)["continuous"], resolution, **options)


def both_ways(largest, states):
    """Values of a test: to the largest, back to 0, to its negative, and back; the ends hit exactly."""
    up = largest * np.arange(1, states + 1) / states
    back = np.append(up[-2::-1], 0.0)
    return np.concatenate([up, back, -up, -back])


def followed_at(curves):
    """The Resolution at which effects of assumptions are followed: the finest of the curves' that has no more
    than FOLLOWED control points, or that many; each alternative is solved anew."""
    every = sorted((one.model.resolution for one in curves), key=lambda one: one.points)
    own = next((one for one in reversed(every) if one.points <= FOLLOWED), None)
    return own or replace(every[0], points=FOLLOWED, contacts=None)


def variants_dataset(fabric, stage, solved, headlines, timings):
    """Dataset of a test in all its conditions, with the effect of the assumptions.

    solved: {condition: (its curve, a function of the number of rows that gives its Dataset)}; headlines:
    as ledger.effect_dataset takes them.  Where a curve ended early stands in ``stop_reason``.
    """
    steps = max(curve.steps for curve, _ in solved.values())
    dataset = stack_variants({name: dataset_of(steps) for name, (_, dataset_of) in solved.items()})
    with timings.measure("effect of the assumptions"):
        dataset = dataset.merge(effect_dataset(fabric, closure(stage), headlines))
    dataset["diameter"] = fabric.yarn["diameter"]
    dataset.attrs["readings"] = to_json(fabric.scene[stage]["variants"])
    dataset.attrs["fabric_history"] = history_json(fabric)
    dataset.attrs["stop_reason"] = "; ".join(
        f"{name}: {curve.stop_reason}" for name, (curve, _) in solved.items() if curve.stop_reason
    )
    return dataset
