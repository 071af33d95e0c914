"""Numba, set up so that its on-disk cache never serves stale machine code, and compiles what is used.

Numba checks only the file of the compiled function itself: an edited kernel that another one calls,
or a changed imported constant, would leave old machine code in use.  So the cache lies in a
directory named by a hash of all sources that compiled code can come from.  Kernels are decorated
with :data:`njit` from here, never from numba, so that the directory is set before any decorator
runs.

What a scene does not have stands as an empty tuple in it.  Its type then tells the compiler, and a
function made by :func:`choose` is compiled for what is there alone.
"""

import functools
import gc
import inspect
import os
import sys

import numba
import numpy as np
from numba import types
from numba.core import caching, event
from numba.extending import overload

from knitsim.files import cache_root
from knitsim.provenance import kernel_hash

CACHE_DIR = cache_root() / f"numba-{kernel_hash()}"
numba.config.CACHE_DIR = str(CACHE_DIR)


class _CarefulFile(caching.IndexDataCacheFile):
    """Numba's files of one kernel; one that is cut short or cannot be written costs its compilation only."""

    def load(self, key):
        try:
            return super().load(key)
        except Exception as error:
            self._told("is damaged, compiled anew", error)
            try:
                os.unlink(self._index_path)
            except OSError:
                pass
            return None

    def save(self, key, data):
        try:
            super().save(key, data)
        except Exception as error:
            self._told("cannot be written, compiled again next time", error)

    def _told(self, what, error):
        print(f"knitsim: compiled kernel {self._index_path} {what} ({error})", file=sys.stderr)


caching.IndexDataCacheFile = _CarefulFile

# No fastmath: it would let a NaN pass the checks that must catch it.  No wrappers for C, which nothing
# here asks for and which take time to compile.
OPTIONS = {"error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": True}
njit = functools.partial(numba.njit, cache=True, **OPTIONS)
# For kernels that make no array: they borrow those that they are given.  Counting references, atomic and
# once or twice a call, took a third of the time of all kernels.
leaf = functools.partial(njit, _nrt=False)


def choose(path, there, gone):
    """A function for kernels: ``there`` where ``path`` is present, ``gone`` where it is ().

    path: name of an argument, or of a field of one (``scene.bend``).  there, gone: kernels of the same
    arguments, or made by this; gone may also be a number, which is then returned.  Only one of the two
    is compiled.
    """
    argument, *fields = path.split(".")
    names = ", ".join(inspect.signature(there).parameters)
    place = list(inspect.signature(there).parameters).index(argument)

    def made(function):
        if callable(function):  # itself, not a call of it: that would be compiled in addition
            return getattr(function, "py_func", function)
        return eval(f"lambda {names}: {function!r}")

    with_it, without = made(there), made(gone)

    def stub(*given):
        value = given[place]
        for field in fields:
            value = getattr(value, field)
        one = gone if isinstance(value, tuple) and value == () else there
        return one(*given) if callable(one) else one

    # Numba wants a chooser with the same arguments as what it chooses between.
    stub = eval(f"lambda {names}: stub({names})", {"stub": stub})

    def chosen(*kinds):
        kind = kinds[place]
        for field in fields:
            kind = kind[kind.fields.index(field)]
        absent = isinstance(kind, types.BaseTuple) and len(kind) == 0
        one = without if absent else with_it
        return one.chosen(*kinds) if hasattr(one, "chosen") else one

    stub.chosen = chosen
    stub.borrows = all(_borrows(one) for one in (there, gone))
    chooser = eval(f"lambda {names}: chosen({names})", {"chosen": chosen})
    options = OPTIONS | {"no_cpython_wrapper": True, "_nrt": not stub.borrows}
    overload(stub, jit_options=options)(chooser)
    return stub


def _borrows(one):
    """Whether a kernel, or what :func:`choose` has made, is a leaf; a number is."""
    if not callable(one):
        return True
    return getattr(one, "borrows", None) or not getattr(one, "targetoptions", {}).get("_nrt", True)


def blank(shape, row):
    """Records of the type ``row``, all zero; with Numba and without, fields are attributes."""
    return np.zeros(shape, dtype=row).view(np.recarray)


@overload(blank)
def _blank(shape, row):
    return lambda shape, row: np.zeros(shape, dtype=row)


class _NoCollection(event.Listener):
    """Keeps Python's garbage collector still while Numba compiles.

    Compiling makes millions of small objects that live until its end; looking through them again and
    again took a fifth of the time.
    """

    def __init__(self):
        self.depth, self.collects = 0, False

    def on_start(self, event):
        if self.depth == 0:
            self.collects = gc.isenabled()
            gc.disable()
        self.depth += 1

    def on_end(self, event):
        self.depth -= 1
        if self.depth == 0 and self.collects:
            gc.enable()


event.register("numba:compile", _NoCollection())


def compilation_timer():
    """Context manager that yields a listener: ``done``, and ``duration`` (s) of what was compiled.

    Nested compilations count once, as the outermost.
    """
    return event.install_listener("numba:compile", event.TimingListener())
