"""Reading a YAML file without its traps: duplicate keys, 5e-9 as text, ``no`` as false, 0123 as 83.

Scalars are read as YAML 1.2 has them, whatever PyYAML's own rules are.
"""

import re

import yaml

from knitsim.errors import InputError

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
_CORE_TAGS = {
    f"tag:yaml.org,2002:{name}"
    for name in ("str", "int", "float", "bool", "null", "map", "seq", "timestamp", "value", "merge")
}
_DEEPEST = 12
_MOST = 200_000  # values in a file


def read_yaml(path):
    """The content of the YAML file ``path`` (a Path): dict, list, str, int, float, bool and None.

    Raises InputError, with file and line, if the file cannot be read, is empty, is not YAML, holds
    a key twice, or is no mapping at the top.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(path, None, "no such file; a study has yarns, fabrics, scenes") from None
    except OSError as error:
        raise InputError(path, None, f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(path, None, f"is not UTF-8 text (byte {error.start})") from None
    content = parsed(text, path)
    if content is None:
        raise InputError(path, None, "is empty; must hold a mapping of names to their keys")
    if not isinstance(content, dict):
        raise InputError(f"{path}:1", None, "must hold a mapping of names to their keys")
    return content


def _has_tab(text, number):
    lines = text.splitlines()
    return number < len(lines) and "\t" in lines[number]


def parsed(text, path):
    """The content of YAML ``text``; path: what messages name.  Raises InputError."""
    try:
        node = yaml.compose(text, Loader=_LOADER)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        tab = "; it has a tab, where blanks must be" if mark and _has_tab(text, mark.line) else ""
        raise InputError(f"{path}{line}", None, f"is not YAML: {error.problem}{tab}") from None
    except RecursionError:
        raise InputError(path, None, "is nested too deeply") from None
    except yaml.YAMLError as error:
        reason = getattr(error, "reason", None) or str(error).splitlines()[0]
        raise InputError(path, None, f"is not YAML: {reason}") from None
    return None if node is None else _Reader(path).value(node, 0)


class _Reader:
    """The value of a node.  Aliases share nodes: a few lines of them can stand for billions of values."""

    def __init__(self, path):
        self.path, self.read = path, 0

    def value(self, node, depth):
        path, self.read = self.path, self.read + 1
        where = f"{path}:{node.start_mark.line + 1}"
        if depth > _DEEPEST:
            raise InputError(where, None, "is nested too deeply")
        if self.read > _MOST:
            raise InputError(
                where, None, f"holds more than {_MOST} values, aliases (*name) counted out"
            )
        if node.tag not in _CORE_TAGS:
            raise InputError(where, node.tag, "YAML tags are not used here")
        if isinstance(node, yaml.ScalarNode):
            plain = not node.style
            return _scalar(node.value) if plain else node.value
        if isinstance(node, yaml.SequenceNode):
            return [self.value(child, depth + 1) for child in node.value]
        mapping = {}
        for key_node, child in node.value:
            line = f"{path}:{key_node.start_mark.line + 1}"
            if not isinstance(key_node, yaml.ScalarNode):
                raise InputError(line, None, "a key must be one word")
            # A key is a name as it is written, be it 12 or no.
            key = key_node.value
            if key in mapping:
                raise InputError(f"{line}: {key}", None, "stands twice in the same mapping")
            mapping[key] = self.value(child, depth + 1)
        return mapping


def _scalar(text):
    if text.lower() in _WORDS and text in (text.lower(), text.upper(), text.title()):
        return _WORDS[text.lower()]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _NUMBER.fullmatch(text):
        return float(text)
    if _SPECIAL.fullmatch(text):
        return float(text.lower().replace(".", ""))
    return text
