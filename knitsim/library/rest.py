"""The fabric at rest, from which every test starts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from knitsim.equilibrium.accuracy import rest_to
from knitsim.equilibrium.relax import Relaxed
from knitsim.equilibrium.relax import relax as solve
from knitsim.errors import InputError
from knitsim.library.result import Result, settings_text
from knitsim.stages.described import describe_stage
from knitsim.stages.equilibrium import named_by_key, settings_of, solver_fabric
from knitsim.stages.equilibrium_rest import STAGE, mass_per_area, rest_dataset
from knitsim.stages.laws import calibration_of, laws_of
from knitsim.study.check import check_value
from knitsim.study.schema import SCENE
from knitsim.study.study import Fabric

if TYPE_CHECKING:
    import xarray as xr


class Rest(Result):
    """A fabric in equilibrium without load; made by :func:`knitsim.relax`.

    wale_spacing, course_spacing (m), kc, kw (1): of the fabric at rest; error (1): estimated relative error
    of the spacings; state: the solution (:class:`knitsim.equilibrium.relax.Relaxed`).
    """

    def __init__(self, fabric: Fabric) -> None:
        super().__init__(fabric)
        self.law = laws_of(fabric.yarn, calibration_of(fabric.yarn))["continuous"]
        self._starts: dict[tuple[tuple[str, Any], ...], Relaxed] = {}
        self._settings = settings_of(fabric)
        self.state: Relaxed
        self.error: float
        self.state, self.error = rest_to(self.start(), self._settings.accuracy)

    def start(self, **changes: Any) -> Relaxed:
        """The state that a test starts from; changes: keywords of the solver's fabric."""
        key = tuple(sorted(changes.items()))
        if key not in self._starts:
            with named_by_key(self.fabric, self.law):
                built = solver_fabric(self.fabric, self.law, **changes)
                self._starts[key] = solve(built, self._settings.resolution)
        return self._starts[key]

    @property
    def wale_spacing(self) -> float:
        """Width of a loop at rest (m)."""
        return float(self.state.wale_spacing)

    @property
    def course_spacing(self) -> float:
        """Height of a course at rest (m)."""
        return float(self.state.course_spacing)

    @property
    def kc(self) -> float:
        """Munden's constant: loop length over course spacing."""
        return float(self.fabric["loop_length"]) / self.course_spacing

    @property
    def kw(self) -> float:
        """Munden's constant: loop length over wale spacing."""
        return float(self.fabric["loop_length"]) / self.wale_spacing

    @property
    def mass_per_area(self) -> float:
        """Mass per area (kg/m2): count times loop length over the area of a loop."""
        return float(mass_per_area(self.fabric, self.state))

    def _dataset(self) -> xr.Dataset:
        dataset = rest_dataset(self.fabric, self.state, self.error)
        described: xr.Dataset = describe_stage(
            dataset, self.fabric, STAGE,
            title=f"Fabric {self.fabric.name} at rest in the equilibrium model",
            summary="One interlooped yarn in a periodic lattice, both spacings free, no load.",
            references=("peirce", "munden"), settings=settings_text(self.fabric, {"rest": self.state}),
        )  # fmt: skip
        return described

    def __repr__(self) -> str:
        w, c = 1e3 * self.wale_spacing, 1e3 * self.course_spacing
        return (
            f"<Rest: {w:.3f} x {c:.3f} mm, {10 / w:.1f} wales and {10 / c:.1f} courses per cm, "
            f"kc {self.kc:.2f}, kw {self.kw:.2f}, {1e3 * self.mass_per_area:.3g} g/m2, "
            f"error {100 * self.error:.1g} %"
            f"{', jammed: the loop is too short for so thick a yarn' if self.state.jammed else ''}>"
        )


def relax(
    fabric: Fabric,
    *,
    accuracy: float | None = None,
    points: int | None = None,
    cell: str | None = None,
) -> Rest:
    """The fabric at rest: the loops find their own shape and spacings.

    accuracy: relative error of spacings, forces and moments that is asked for (0.01); points: instead,
    control points of one loop; cell: "symmetric" or "full".  Those left out are as the fabric's scene has
    them; keys of ``equilibrium_rest``.  Tests of the result keep them.

    Raises InputError for a yarn that the loop has no room for, :class:`knitsim.errors.ComputationError` where
    no equilibrium is found.

    >>> import knitsim as ks
    >>> yarn = ks.Yarn(count_tex=19.7, bending_rigidity_N_mm2=2e-3)
    >>> rest = ks.relax(ks.Fabric(yarn, wales_per_cm=14, courses_per_cm=20, loop_length_mm=2.9))
    >>> rest
    <Rest: 0.750 x 0.543 mm, 13.3 wales and 18.4 courses per cm, kc 5.34, kw 3.87, 140 g/m2, error 0.0009 %>
    """
    keys = {"accuracy": accuracy, "points": points, "cell": cell}
    if not isinstance(fabric, Fabric):
        raise InputError("relax", repr(fabric), "needs a Fabric")
    section = SCENE.section("equilibrium_rest")
    stated = {
        name: check_value(section.key(name), value, f"relax.{name}")
        for name, value in keys.items()
        if value is not None
    }
    return Rest(fabric.with_rest(**stated))
