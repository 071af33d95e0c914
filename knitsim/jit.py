"""Numba, set up so that its on-disk cache never serves stale machine code, and compiles what is used.

Numba checks only the file of the compiled function itself: an edited kernel that another one calls,
or a changed imported constant, would leave old machine code in use.  So the cache lies in a
directory named by a hash of all sources that compiled code can come from.  Kernels are decorated
with :data:`njit` from here, never from numba, so that the directory is set before any decorator
runs.

A kernel is made ready for Python only where Python calls it, and machine code is made of those alone:
a kernel takes in the kernels that it calls as a whole.  This halves the work of the compiler.

What a scene does not have stands as an empty tuple in it.  Its type then tells the compiler, and a
function made by :func:`choose` is compiled for what is there alone.
"""

import functools
import gc
import inspect
import os
import sys

import llvmlite.binding as llvm
import numba
import numpy as np
from numba import types
from numba.core import caching, codegen, event, sigutils
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import PassManager
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher
from numba.core.targetconfig import ConfigStack, TargetConfig
from numba.core.typed_passes import AnnotateTypes
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


class _Passes(CompilerBase):
    """Numba's passes over a kernel without its notes on types, which nobody reads."""

    def define_pipelines(self):
        passes = PassManager("kernel")
        whole = DefaultPassBuilder.define_nopython_pipeline(self.state).passes
        passes.passes = [one for one in whole if one[0] is not AnnotateTypes]
        passes.finalize()
        return [passes]


# Numba looks options up by a hash of their names, that are always the same, and then compares them all.
TargetConfig.__hash__ = lambda self: hash(type(self))
TargetConfig.__eq__ = lambda self, other: (
    isinstance(other, TargetConfig)
    and (self._values == other._values or self.values() == other.values())
)

# No fastmath: it would let a NaN pass the checks that must catch it.  No wrappers for C, which nothing
# here asks for and which take time to compile.
OPTIONS = {"error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": True}


class _Library(codegen.JITCodeLibrary):
    """Numba's code of one function; ``inner``, not machine code, where neither Python nor C has a way in."""

    inner = False

    def finalize(self):
        flags = ConfigStack.top_or_none()
        self.inner = bool(flags and flags.no_cpython_wrapper and flags.no_cfunc_wrapper)
        super().finalize()

    def _optimize_final_module(self):
        if not self.inner:
            super()._optimize_final_module()

    def _finalize_final_module(self):
        if not self.inner:
            return super()._finalize_final_module()
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def _finalize_specific(self):
        super()._finalize_specific()
        for variable in self._final_module.global_variables:
            environment = lookup_environment(variable.name)
            if environment is not None:
                self._codegen.set_env(variable.name, environment)

    def get_pointer_to_function(self, name):
        self._ensure_finalized()
        return 0 if self.inner else super().get_pointer_to_function(name)

    def serialize_using_object_code(self):
        return (
            self.serialize_using_bitcode() if self.inner else super().serialize_using_object_code()
        )

    @classmethod
    def _unserialize(cls, codegen, state):
        name, kind, data = state
        if kind != "bitcode":
            return super()._unserialize(codegen, state)
        self = codegen.create_library(name)
        self.inner, self._final_module = True, llvm.parse_bitcode(data)
        self._finalize_final_module()
        return self


def _set_env(self, name, environment, _set=codegen.JITCPUCodegen.set_env):
    if self._engine.get_global_value_address(name):  # an inner library's has none yet
        _set(self, name, environment)


codegen.JITCPUCodegen._library_class, codegen.JITCPUCodegen.set_env = _Library, _set_env


class _Files(caching.FunctionCache):
    """Numba's files of one kernel, which keep it with and without a way in from Python."""

    way_in = False

    def _index_key(self, sig, codegen):
        return super()._index_key(sig, codegen) + (self.way_in,)

    def load_overload(self, sig, target_context):
        found = super().load_overload(sig, target_context)
        if found is None:
            _say_once()
        return found


@functools.cache
def _say_once():
    """Tell a person who waits, at a terminal or in a notebook, what for."""
    if sys.stderr.isatty() or "ipykernel" in sys.modules:
        print(
            "knitsim: compiling for this machine, once; up to half a minute",
            file=sys.stderr, flush=True,
        )  # fmt: skip


class _Kernel(CPUDispatcher):
    """Numba's kernel, with a way in from Python where Python calls it."""

    _called = False  # by Python

    def enable_caching(self):
        self._cache = _Files(self.py_func)

    def _compile_for_args(self, *args, **kws):
        self._called = True
        try:
            return super()._compile_for_args(*args, **kws)
        finally:
            self._called = False

    def compile(self, sig):
        arguments = tuple(sigutils.normalize_signature(sig)[0])
        there = self.overloads.get(arguments)
        if self._called and there is not None and there.library.inner:
            del self.overloads[arguments]
        self._cache.way_in = self._called
        self.targetoptions["no_cpython_wrapper"] = not self._called
        # What Numba compiles of its own on the way is called from kernels alone, too.
        wrapper = Flags.options["no_cfunc_wrapper"]
        before, wrapper._default = wrapper._default, True
        try:
            return super().compile(sig)
        finally:
            wrapper._default = before

    def add_overload(self, cres):
        if cres.library.inner:
            self.overloads[tuple(cres.signature.args)] = cres
        else:
            super().add_overload(cres)


def njit(function=None, **options):
    """Decorator of a kernel, as numba.njit with OPTIONS and files; options: others of Numba's."""
    if function is None:
        return functools.partial(njit, **options)
    if numba.config.DISABLE_JIT:
        return function
    kernel = _Kernel(
        function,
        targetoptions=OPTIONS | {"nopython": True, "boundscheck": None} | options,
        pipeline_class=_Passes,
    )
    kernel.enable_caching()
    return kernel


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
    options = OPTIONS | {
        "no_cpython_wrapper": True,
        "_nrt": not stub.borrows,
        "pipeline_class": _Passes,
    }
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
