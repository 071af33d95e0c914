"""knitsim: how a plain weft-knitted fabric behaves, computed from what its yarn is made of.

The sub-packages follow the method, and imports run in this direction only:
store -> measured -> yarn -> loop -> kinematic | equilibrium -> kes -> study -> inference ->
verification -> benchmark -> figures -> stages.

``knitsim.open_store`` and ``knitsim.scalar_table`` read what the workflow has written.  They are
loaded on first use, because the Snakefile imports this package and must start fast.
"""

from importlib import import_module

__version__ = "0.1.0"
__all__ = ["__version__", "open_store", "scalar_table"]


def __getattr__(name):
    if name in ("open_store", "scalar_table"):
        return getattr(import_module("knitsim.store.reader"), name)
    raise AttributeError(f"module 'knitsim' has no attribute '{name}'")
