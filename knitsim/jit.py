"""Numba, set up so that its on-disk cache never serves stale machine code.

Numba checks only the file of the compiled function itself: an edited kernel that another one calls,
or a changed imported constant, would leave old machine code in use.  So the cache lies in a
directory named by a hash of all sources that compiled code can come from.  Kernels are decorated
with :data:`njit` from here, never from numba, so that the directory is set before any decorator
runs.
"""

import functools

import numba
from numba.core import event

from knitsim.files import cache_root
from knitsim.provenance import kernel_hash

CACHE_DIR = cache_root() / f"numba-{kernel_hash()}"
numba.config.CACHE_DIR = str(CACHE_DIR)

# No fastmath: it would let a NaN pass the checks that must catch it.  No wrappers for C, which nothing
# here asks for and which take time to compile.
njit = functools.partial(numba.njit, cache=True, error_model="numpy", no_cfunc_wrapper=True)


def compilation_timer():
    """Context manager that yields a listener: ``done``, and ``duration`` (s) of what was compiled.

    Nested compilations count once, as the outermost.
    """
    return event.install_listener("numba:compile", event.TimingListener())
