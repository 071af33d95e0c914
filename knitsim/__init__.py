"""knitsim: how a weft-knitted fabric behaves, computed from what its yarn is made of.

A fabric in five lines::

    import knitsim as ks
    yarn = ks.Yarn(count_tex=19.7, friction=0.25)      # or count="30/1"; all else is assumed, and said so
    fabric = ks.Fabric(yarn, wales_per_cm=14, courses_per_cm=20, loop_length_mm=2.9)
    rest = ks.relax(fabric)                            # the loops find their own shape and spacings
    pull = ks.pull(rest, "course", to_strain=0.3, recovery=True)

What is made
    Yarn, Fabric               keywords are the keys of yarns.yaml and fabrics.yaml, unit at the end
    relax                      the fabric at rest
    pull, biaxial, shear, bend its tests, as the Kawabata instruments do them
    kes                        EMT, LT, WT, RT, B, 2HB, G, 2HG of a test, computed or measured
    sweep                      many fabrics, in processes: one dataset; Pull, Bend, Shear, Biaxial say how
    read_measured              a measured curve, from the file that a machine or Excel wrote
    calibrate, predict         inputs found from measured curves; other tests predicted, with a band
    load_study                 the yarns and fabrics of a directory of YAML files
    open_store, scalar_table   what the workflow has written

What comes out
    Rest and every test have to_dataset() (xarray, the store's names and attributes), to_dataframe() (pandas),
    to_netcdf(path) and plot() (matplotlib axes); a measured curve, a calibration and a prediction have
    to_dataframe() and plot().  Printed, each is one line.

Units
    Keywords carry theirs (loop_length_mm); everything else is SI.  Strain is engineering strain from rest, a
    fraction.  Course is along the width, wale along the length; the technical face is up.

What goes wrong
    knitsim.errors.InputError: one line that names the key, the value and what is right, before any computing.
    knitsim.errors.ComputationError: valid input for which no equilibrium was found.

Names are loaded on first use, because the Snakefile imports this package and must start fast.
"""

from importlib import import_module

__version__ = "0.1.0"
_HOME = {
    "Yarn": "study.study",
    "Fabric": "study.study",
    "relax": "library.rest",
    "pull": "library.tests",
    "bend": "library.tests",
    "shear": "library.tests",
    "biaxial": "library.tests",
    "Pull": "library.tests",
    "Bend": "library.tests",
    "Shear": "library.tests",
    "Biaxial": "library.tests",
    "kes": "library.kes",
    "sweep": "library.sweep",
    "calibrate": "library.inference",
    "predict": "library.inference",
    "read_measured": "measured.read",
    "load_study": "study.study",
    "open_store": "store.reader",
    "scalar_table": "store.reader",
}
__all__ = ["__version__", *_HOME]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module 'knitsim' has no attribute '{name}'")
    module = import_module(f"knitsim.{_HOME[name]}")
    if name == "kes":
        # The room of that name, which the module has made callable.
        return import_module("knitsim.kes")
    return getattr(module, name)


def __dir__():
    return sorted(__all__)
