"""The files of a study, kept beside the results: what was checked is what is run, whatever is edited
meanwhile.
"""

import os
import re
import shutil
from pathlib import Path

from knitsim.files import replacing

UP = "@up"  # a directory for each .. that the paths begin with


def folder_of(study, root, digest):
    """The directory from which the paths of a Study's files lead to the kept ones."""
    up = max((_relative(file).parts.count("..") for file in study.files), default=0)
    return Path(root).absolute() / digest / Path(*[UP] * up)


def stamps(study):
    """What changes when a file of the directory ``study`` is edited."""
    found = (path.stat() for path in sorted(Path(study).glob("*.yaml")))
    return [(one.st_mtime_ns, one.st_size, one.st_ino) for one in found]


def _kept(root):
    """What was kept there; anything else in the directory is not ours."""
    return [one for one in sorted(root.glob("*")) if re.fullmatch("[0-9a-f]{16}", one.name)]


def running(root):
    """That directory of the run that is under way, or None."""
    for folder in _kept(Path(root).absolute()):
        while (folder / UP).is_dir():
            folder = folder / UP
        return folder
    return None


def _relative(file):
    return Path(os.path.relpath(file))


def keep(contents, folder, root, digest):
    """Write ``contents`` {path: bytes} to be found from ``folder``; what ``root`` kept before goes."""
    root = Path(root)
    for old in _kept(root):
        if old.name != digest:
            shutil.rmtree(old, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    for file, content in contents.items():
        with replacing(Path(os.path.normpath(folder / _relative(file)))) as partial:
            partial.write_bytes(content)
