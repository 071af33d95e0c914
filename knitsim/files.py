"""Writing files whole or not at all, so that a killed run leaves no half-written result."""

import errno
import functools
import glob
import os
import sys
import tempfile
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


@functools.cache
def cache_root():
    """Directory of what may be thrown away: compiled kernels, and which studies were checked.

    One that cannot be written to is said once, and a temporary one is used instead.
    """
    own = os.environ.get("KNITSIM_CACHE_DIR")
    try:
        above = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        found = Path(own or Path(above) / "knitsim")
        found.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=found):
            return found
    except (OSError, RuntimeError) as error:  # RuntimeError: there is no home
        why = getattr(error, "strerror", None) or error
        instead = Path(tempfile.gettempdir()) / f"knitsim-{getattr(os, 'getuid', int)()}"
        if "KNITSIM_CACHE_TOLD" not in os.environ:
            os.environ["KNITSIM_CACHE_TOLD"] = "1"  # the jobs of a run need not say it again
            print(
                f"knitsim: the cache of compiled kernels cannot be written ({why}): {instead} is used; "
                "KNITSIM_CACHE_DIR names another place",
                file=sys.stderr,
            )
        instead.mkdir(mode=0o700, parents=True, exist_ok=True)
        return instead


def full_disk(error):
    """Whether an exception, or one that led to it, says that there is no room for a file."""
    while error is not None:
        if getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            return True
        error = error.__cause__ or error.__context__
    return False


def is_whole(path):
    """Whether a netCDF file is as long as it says of itself, other files: whether they hold anything."""
    try:
        with open(path, "rb") as file:
            head, size = file.read(52), os.fstat(file.fileno()).st_size
    except OSError:
        return False
    if Path(path).suffix != ".nc":
        return size > 0
    if len(head) < 52 or not head.startswith(b"\x89HDF\r\n\x1a\n"):
        return False
    # HDF5's superblock: the end of the file stands behind three or two addresses of eight bytes.
    start = {0: 40, 1: 44}.get(head[8], 28)
    return size >= int.from_bytes(head[start : start + 8], "little")
