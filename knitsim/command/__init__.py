"""The command ``knitsim``: a study made, checked, run and shown; one fabric; one measured file.

Nothing heavy is imported before it is known what is asked for.
"""

import argparse
import sys
from importlib import import_module

from knitsim.errors import ComputationError, InputError

# Name: the module of this room that does it, and what it is for.
COMMANDS = {
    "new": ("study", "make a study to edit: yarns, fabrics, tests"),
    "check": ("study", "check a study without computing"),
    "run": ("run", "compute a study: results, tables, figures and a page"),
    "show": ("show", "what a run has found, as a table"),
    "fabric": ("fabric", "one fabric on the screen"),
    "predict": ("predict", "what measured curves teach of a fabric and predict, with bands"),
    "read": ("", "show what is recognised in a file of a measured test"),
}


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, as every other refusal is."""

    def error(self, message):
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def parser():
    """The ArgumentParser of the command."""
    import knitsim

    top = _Parser(prog="knitsim", description=knitsim.__doc__.splitlines()[0])
    top.add_argument("--version", action="version", version=f"knitsim {knitsim.__version__}")
    parts = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (module, about) in COMMANDS.items():
        part = parts.add_parser(
            name, help=about, description=about, add_help=bool(module), allow_abbrev=False
        )
        if module:
            getattr(import_module(f"knitsim.command.{module}"), f"{name}_options")(part)
    return top


def main(arguments=None):
    """Do what ``arguments`` (of the process where None) ask for; the exit status."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if arguments[:1] == ["read"]:  # has options of its own
        from knitsim.measured.report import main as read

        return read(arguments[1:])
    given, more = parser().parse_known_args(arguments)
    takes_more = given.command in ("run", "fabric")
    if more and not takes_more:
        parser().error(f"unknown: {' '.join(more)}")
    module = import_module(f"knitsim.command.{COMMANDS[given.command][0]}")
    try:
        return getattr(module, given.command)(given, *([more] if takes_more else []))
    except (InputError, ComputationError) as error:
        print(f"knitsim: {error}", file=sys.stderr)
    except BrokenPipeError:  # what reads the screen has seen enough
        sys.stderr.close()
    return 1
