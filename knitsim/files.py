"""Writing files whole or not at all, so that a killed run leaves no half-written result."""

import glob
import os
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path):
    """Yield a temporary path beside ``path``; what is written there replaces ``path`` at the end.

    On an exception nothing is left behind and ``path`` is as before.  Missing directories are made.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # What a killed writer of this file has left; no two jobs write the same file.
    for left in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        left.unlink(missing_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def cache_root():
    """Directory of what may be thrown away: compiled kernels, and which studies were checked."""
    own = os.environ.get("KNITSIM_CACHE_DIR")
    return Path(own or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "knitsim")
