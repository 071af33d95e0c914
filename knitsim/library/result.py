"""What every result has in common: a dataset of the store's schema, a table, a plot, one line."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from knitsim.stages.equilibrium import settings_of
from knitsim.store.writer import with_attributes, write
from knitsim.study.study import Fabric

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes


class Result(ABC):
    """A computed state or test of a fabric.

    fabric: the :class:`knitsim.Fabric`, with the test as its scene.
    """

    def __init__(self, fabric: Fabric) -> None:
        self.fabric = fabric

    @abstractmethod
    def _dataset(self) -> xr.Dataset:
        """What the result holds, before the attributes of its names."""

    def to_dataset(self) -> xr.Dataset:
        """All of it as a dataset of the result store: names, units, signs and attributes are the same.

        >>> import knitsim as ks
        >>> fabric = ks.Fabric(ks.Yarn(count_tex=20), loop_length_mm=2.9)
        >>> rest = ks.relax(fabric, points=48).to_dataset()
        >>> rest["kc"].attrs["long_name"]
        "Munden's constant, loop length over course spacing"
        """
        dataset: xr.Dataset = with_attributes(self._dataset())
        return dataset

    def to_netcdf(self, path: str | Path) -> None:
        """Write :meth:`to_dataset` to a file, whole or not at all."""
        write(self._dataset(), Path(path))

    def to_dataframe(self) -> pd.DataFrame:
        """The numbers of each state, one row a state, in SI and under the names of the store.

        >>> import knitsim as ks
        >>> fabric = ks.Fabric(ks.Yarn(count_tex=20), loop_length_mm=2.9)
        >>> frame = ks.pull(fabric, "course", to_strain=0.1, states=2).to_dataframe()
        >>> list(frame.columns[:4])
        ['strain', 'phase', 'cycle', 'segment']
        """
        import pandas as pd  # late, as xarray is: a curve on the screen needs none

        dataset = self.to_dataset()
        along = {"step"} if "step" in dataset.dims else set()
        kept = [
            name
            for name in (*dataset.coords, *dataset.data_vars)
            if set(dataset[name].dims) == along
        ]
        columns = {
            str(name): np.atleast_1d(dataset[name].values) for name in kept if name != "step"
        }
        return pd.DataFrame(columns)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw it; the matplotlib axes (new ones without ``ax``).  options: of the lines."""
        from knitsim.library.plots import draw
        from knitsim.measured.drawn import axes_for

        axes: Axes = axes_for(ax)
        draw(self, axes, **options)
        return axes


def settings_text(fabric: Fabric, solved: dict[str, Any]) -> dict[str, Any]:
    """How finely it was solved, as the attribute ``settings`` of a result file has it."""
    told: dict[str, Any] = settings_of(fabric).told(solved)
    return told
