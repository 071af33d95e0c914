"""Objects made by hand: keywords for the keys of an entry, checked as those of a file are."""

import inspect

from knitsim.errors import InputError
from knitsim.study.check import check_name, check_section

_NOT_BY_HAND = ("scene",)  # there are no scenes.yaml
_OF_AN_OBJECT = ("yarn",)  # given as an object


def stated_tree(section, keys, name):
    """The checked tree of ``keys`` {key: value} for an entry called ``name``.  Raises InputError."""
    check_name(name, section.name)
    for key in _NOT_BY_HAND:
        if key in keys:
            raise InputError(f"{name}.{key}", None, "is a key of a study; here tests are functions")
    return check_section(section, _plain(keys), name, sweeps=False)


def _plain(value):
    """A value as a file would give it: arrays and tuples as lists, scalars of numpy as numbers."""
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    # An array or scalar of numpy, which a study is read without.
    return _plain(value.tolist()) if hasattr(value, "tolist") else value


def with_signature(section):
    """A decorator: the keys of a section as the keywords that a class is known to take."""

    def decorated(cls):
        own = list(inspect.signature(cls.__init__).parameters.values())[1:-1]
        names = [key.name for key in section.keys] + [one.name for one in section.sections]
        more = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None)
            for name in names
            if name not in (*_NOT_BY_HAND, *_OF_AN_OBJECT)
        ]
        cls.__signature__ = inspect.Signature([*own, *more])
        return cls

    return decorated
