"""The results of tests: the curve, as a dataset, a table or a plot, in one line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from knitsim.equilibrium.accuracy import largest_error
from knitsim.equilibrium.dataset import bend_dataset, pull_dataset
from knitsim.equilibrium.pull import biaxial, shear
from knitsim.equilibrium.result import BendingCurve, Curve
from knitsim.equilibrium.whole_test import from_rest
from knitsim.kes.curl import Curl, curl
from knitsim.library.rest import Rest
from knitsim.library.result import Result, settings_text
from knitsim.stages import equilibrium_bending as bending
from knitsim.stages import equilibrium_shear as shearing
from knitsim.stages import equilibrium_tension as tension
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import both_ways, settings_of
from knitsim.store.tensile import absolute_error
from knitsim.store.writer import to_json
from knitsim.study.study import Fabric
from knitsim.units import from_si

if TYPE_CHECKING:
    import xarray as xr

Numbers = NDArray[np.float64]


class Tested(Result):
    """A test of a fabric.

    rest: the :class:`knitsim.Rest` that it began with; curve: the solution, states in the order visited
    (:class:`knitsim.equilibrium.result.States`); stop_reason: why it ended early, else empty.
    """

    KIND = ""
    STAGE = ""
    SUMMARY = "One interlooped yarn in a periodic lattice, in equilibrium in every state."

    curve: Curve | BendingCurve

    def __init__(self, rest: Rest, fabric: Fabric, direction: str = "") -> None:
        super().__init__(fabric)
        self.rest, self.direction = rest, direction

    @property
    def stop_reason(self) -> str:
        """Why the test ended early; empty where it did not."""
        return str(self.curve.stop_reason)

    @property
    def error(self) -> float:
        """Largest estimated relative error of the forces or moments; infinite where not known."""
        return float(largest_error(self.curve))

    def _described(self, dataset: xr.Dataset, title: str, **labels: str) -> xr.Dataset:
        dataset["diameter"] = self.fabric.yarn["diameter"]
        test = self.fabric.scene[self.STAGE]
        dataset.attrs["readings"] = to_json(test.get("variants", test))
        dataset.attrs["stop_reason"] = self.stop_reason
        described: xr.Dataset = describe_stage(
            dataset, self.fabric, self.STAGE, title=title, summary=self.SUMMARY, references=("munden",),
            settings=settings_text(self.fabric, {self.KIND: self.curve}), **labels,
        )  # fmt: skip
        return described

    def _told(self, reached: str) -> str:
        error = "" if math.isinf(self.error) else f", error {100 * self.error:.1g} %"
        beyond = self.curve.yarn_strain > self.curve.model.fabric.law.breaking_strain
        broken = "; the yarn is strained beyond its break" if beyond.any() else ""
        ended = f"; ended early: {self.stop_reason}" if self.stop_reason else ""
        what = f"{self.KIND.title()} {self.direction}".strip()
        return f"<{what}: {self.curve.steps} states to {reached}{error}{broken}{ended}>"


def _choice(fabric: Fabric, stage: str) -> dict[str, Any]:
    """The one condition of a test."""
    (choice,) = fabric.scene[stage]["variants"].values()
    return dict(choice)


class Pulled(Tested):
    """A tension test; made by :func:`knitsim.pull`.

    strain (steps,), force_per_width (steps,) N/m over the width at rest, force_per_loop (N).
    """

    KIND, STAGE = "pull", tension.STAGE

    def __init__(self, rest: Rest, fabric: Fabric, direction: str) -> None:
        choice = _choice(fabric, self.STAGE)
        start = rest.start(friction=choice["friction"])
        curve, _ = tension.tested(choice, direction, start, **settings_of(fabric).errors)
        super().__init__(rest, fabric, direction)
        self.curve: Curve = curve

    @property
    def strain(self) -> Numbers:
        """Engineering strain along the pull, from rest (1)."""
        return np.asarray(self.curve.strain)

    @property
    def force_per_width(self) -> Numbers:
        """Force over the width at rest (N/m)."""
        return np.asarray(self.curve.force_per_width)

    def _dataset(self) -> xr.Dataset:
        title = f"Equilibrium tensile test of {self.fabric.name}, {self.direction} direction"
        return self._described(pull_dataset(self.curve), title, direction=self.direction)

    def __repr__(self) -> str:
        at = int(np.argmax(self.strain))
        force = from_si(self.force_per_width[at], "gf_per_cm")
        return self._told(f"{100 * self.strain[at]:.3g} %, {force:.3g} gf/cm there")


class Bent(Tested):
    """A bending test; made by :func:`knitsim.bend`.

    curvature (steps,) 1/m, positive where the technical face is convex; moment_per_width (steps,) N;
    curl: the moment that holds the fabric flat and the side it rolls to (:class:`knitsim.kes.curl.Curl`).
    """

    KIND, STAGE = "bend", bending.STAGE
    SUMMARY = (
        "One interlooped yarn in a lattice rolled about a cylinder, in equilibrium in every state; the "
        "moment is that about the mean plane of the centre line."
    )

    def __init__(self, rest: Rest, fabric: Fabric, direction: str) -> None:
        choice = _choice(fabric, self.STAGE)
        start = bending.relaxed_for(fabric, rest.law, choice, settings_of(fabric).resolution)
        name = next(iter(fabric.scene[self.STAGE]["variants"]))
        curve = bending.bent(fabric, start, direction, name, **settings_of(fabric).errors)
        super().__init__(rest, fabric, direction)
        self.curve: BendingCurve = curve

    @property
    def curvature(self) -> Numbers:
        """Curvature (1/m), positive where the technical face is convex."""
        return np.asarray(self.curve.curvature)

    @property
    def moment_per_width(self) -> Numbers:
        """Moment over the width at rest (N)."""
        return np.asarray(self.curve.moment_per_width)

    @property
    def curl(self) -> Curl:
        """How the fabric curls along this direction, with its error."""
        error = absolute_error(self.moment_per_width, self.curve.numerical_error)
        found: Curl = curl(self.curvature, self.moment_per_width, error, self.curve.cycle)
        return found

    def _dataset(self) -> xr.Dataset:
        title = f"Equilibrium bending of {self.fabric.name}, {self.direction} direction curved"
        return self._described(bend_dataset(self.curve), title, direction=self.direction)

    def __repr__(self) -> str:
        most = from_si(float(np.abs(self.curvature).max()), "per_cm")
        found = self.curl
        side = {"neither": "does not roll", "": ""}.get(
            found.rolls_to, f"rolls to the {found.rolls_to}"
        )
        return self._told(
            f"{most:.3g} per cm, {found.kes_moment:.3g} gf cm/cm holds it flat, {side}"
        )


class Sheared(Tested):
    """A shear test; made by :func:`knitsim.shear`.

    angle (steps,) rad; force_per_width (steps,) N/m, along the course over the width at rest.
    """

    KIND, STAGE = "shear", shearing.STAGE
    SUMMARY = "Shear in the plane under tension along the wale; the force is that along the course."

    def __init__(self, rest: Rest, fabric: Fabric) -> None:
        test = fabric.scene[self.STAGE]
        angles = both_ways(test["max_angle"], test["states"])
        start = rest.start(friction=test["friction"])
        curve = shear(start, angles, tension=test["tension"], **settings_of(fabric).errors)
        super().__init__(rest, fabric)
        self.curve: Curve = curve

    @property
    def angle(self) -> Numbers:
        """Shear angle (rad)."""
        return np.asarray(self.curve.strain)

    @property
    def force_per_width(self) -> Numbers:
        """Shear force over the width at rest (N/m)."""
        return np.asarray(self.curve.force_per_width)

    def _dataset(self) -> xr.Dataset:
        dataset = pull_dataset(self.curve, along="shear_angle")
        return self._described(dataset, f"Equilibrium shear test of {self.fabric.name}")

    def __repr__(self) -> str:
        at = int(np.argmax(self.angle))
        force = from_si(self.force_per_width[at], "gf_per_cm")
        return self._told(f"{math.degrees(self.angle[at]):.3g} degrees, {force:.2g} gf/cm there")


class BiaxiallyPulled(Tested):
    """A biaxial test; made by :func:`knitsim.biaxial`.

    strain, wale_strain (steps,); force_per_width, wale_force_per_width (steps,) N/m, each over the width
    at rest across it.
    """

    KIND, STAGE = "biaxial", tension.STAGE

    def __init__(self, rest: Rest, fabric: Fabric, course: float, wale: float) -> None:
        choice = _choice(fabric, self.STAGE)
        parts = np.arange(1, choice["states"] + 1) / choice["states"]
        curve = biaxial(rest.start(friction=choice["friction"]), parts[:, None] * [course, wale])
        super().__init__(rest, fabric)
        self.curve: Curve = from_rest(curve)

    @property
    def strain(self) -> Numbers:
        """Strain along the course, from rest (1)."""
        return np.asarray(self.curve.strain)

    @property
    def wale_strain(self) -> Numbers:
        """Strain along the wale, from rest (1)."""
        return np.asarray(self.curve.wale_strain)

    @property
    def force_per_width(self) -> Numbers:
        """Force along the course over the width at rest (N/m)."""
        return np.asarray(self.curve.force_per_width)

    @property
    def wale_force_per_width(self) -> Numbers:
        """Force along the wale over the width at rest (N/m)."""
        return np.asarray(self.curve.forces[:, 3]) / self.rest.wale_spacing

    def _dataset(self) -> xr.Dataset:
        dataset = pull_dataset(self.curve)
        dataset["transverse_strain"] = ("step", self.wale_strain)
        dataset["transverse_force_per_width"] = ("step", self.wale_force_per_width)
        title = f"Equilibrium biaxial test of {self.fabric.name}"
        return self._described(dataset, title, direction="biaxial")

    def __repr__(self) -> str:
        strains = f"{100 * self.strain[-1]:.3g} and {100 * self.wale_strain[-1]:.3g} %"
        forces = (
            from_si(one[-1], "gf_per_cm")
            for one in (self.force_per_width, self.wale_force_per_width)
        )
        return self._told(f"{strains}, {' and '.join(f'{one:.3g}' for one in forces)} gf/cm there")
