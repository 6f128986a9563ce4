"""The entry point `ldcs`: the table of verbs, and what every verb has in common (help, errors, status)."""

from __future__ import annotations

import argparse
import importlib
import io
import os
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, NoReturn

from ldcs_ros import __version__
from ldcs_ros.cli.arguments import CommandLineError
from ldcs_ros.errors import LdcsError, user_path
from ldcs_ros.schema.fields import did_you_mean

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130  # 128 + SIGINT, as shells report it
EXIT_BROKEN_PIPE = 141  # 128 + SIGPIPE


class Verb(NamedTuple):
    """The module of a verb, and its line in `ldcs --help`."""

    module: str
    summary: str


VERBS: dict[str, Verb] = {
    "simulate": Verb("ldcs_ros.cli.simulate", "run a scene as fast as it can, record a bag"),
    "replay": Verb("ldcs_ros.cli.replay", "feed a bag's commands to the twin again, check the outcome"),
    "compare": Verb("ldcs_ros.cli.compare", "compare two bags: numbers, pictures, limits"),
    "plot": Verb("ldcs_ros.cli.plot", "draw a bag: surface, points, drives, moving picture"),
    "view": Verb("ldcs_ros.cli.view", "show a bag, or a running twin, in a browser"),
    "export": Verb("ldcs_ros.cli.export", "write a bag as a table: CSV, Parquet, netCDF"),
    "identify": Verb("ldcs_ros.cli.identify", "fit numbers of a scene to bags"),
    "reach": Verb("ldcs_ros.cli.reach", "find the commands under which points rest at their targets"),
    "sensitivity": Verb(
        "ldcs_ros.cli.sensitivity", "print how points move with commands and numbers of a scene"
    ),
    "sweep": Verb("ldcs_ros.cli.sweep", "evaluate a scene at many values: table, picture, Sobol indices"),
    "gym": Verb("ldcs_ros.cli.gym", "measure the environments for reinforcement learning with a baseline"),
    "validate": Verb("ldcs_ros.cli.validate", "repeat the paper's test, print Table I"),
    "study": Verb("ldcs_ros.cli.study", "measure what accuracy costs in time: diagram, report"),
    "recover": Verb(
        "ldcs_ros.cli.recover", "repair a bag left incomplete by a crash, full disk or power loss"
    ),
    "vent": Verb("ldcs_ros.cli.vent", "ramp a rig's set-points to zero, with a confirmed end"),
    "scenes": Verb("ldcs_ros.cli.scenes", "list the shipped scenes"),
    "effects": Verb("ldcs_ros.cli.effects", "list the physical effects and their parameters"),
}


class OneLineParser(argparse.ArgumentParser):
    """An argument parser whose complaint is one line that names the help to read."""

    def check_options(self, words: Sequence[str]) -> None:
        """Refuse an option that the verb does not have, before the ones that it lacks.

        Raises:
            CommandLineError: There is one; the message names the nearest option.
        """
        for word in words[: words.index("--") if "--" in words else None]:
            option = word.partition("=")[0]
            if option.startswith("--") and option not in self._option_string_actions:
                hint = did_you_mean(option, self._option_string_actions)
                raise CommandLineError(
                    f"unknown option '{option}', see `{self.prog} --help`.{hint}".rstrip(".")
                )

    def error(self, message: str) -> NoReturn:
        raise CommandLineError(f"{message}; see `{self.prog} --help`")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb and return its exit status: 0 done, 1 a check failed, 2 bad input, 130 interrupted.

    Args:
        argv: Words after `ldcs`; None takes them from the process.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # paths may hold bytes that are no text
            stream.reconfigure(errors="backslashreplace")
    warnings.showwarning = _note
    try:
        # An overflow of foreign numbers shows in the result, which is checked: the lines of NumPy say nothing more.
        warnings.simplefilter("ignore", RuntimeWarning)
        status = _dispatch(words)
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except LdcsError as error:
        return _complain(str(error))
    except KeyboardInterrupt:
        print("ldcs: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except MemoryError:
        return _complain("there is not enough memory for this input")
    except BrokenPipeError:
        # The reader of our output left (`ldcs effects | head`); the last flush at exit must not complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_BROKEN_PIPE
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        return _complain(f"{error.strerror or error}{where}")


def _dispatch(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help"):
        print(_overview())
        return 0 if words else EXIT_BAD_INPUT
    if words[0] == "--version":
        print(f"ldcs {__version__}")
        return 0
    name = words[0]
    if name not in VERBS:
        raise CommandLineError(
            f"unknown verb '{name}', expected one of {list(VERBS)}.{did_you_mean(name, VERBS)}"
        )
    module = importlib.import_module(VERBS[name].module)
    parser = OneLineParser(
        prog=f"ldcs {name}",
        description=module.DESCRIPTION,
        epilog=f"example:\n  {module.EXAMPLE}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    module.add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object, for machines")
    parser.check_options(words[1:])
    arguments = parser.parse_args(words[1:])
    for option, value in vars(arguments).items():
        if isinstance(value, Path):
            setattr(arguments, option, user_path(value))
        elif isinstance(value, list) and all(isinstance(one, Path) for one in value):
            setattr(arguments, option, [user_path(one) for one in value])
    status: int = module.run(arguments)
    return status


def _overview() -> str:
    width = max(len(name) for name in VERBS)
    verbs = "\n".join(f"  {name:<{width}}  {verb.summary}" for name, verb in VERBS.items())
    return (
        "usage: ldcs <verb> [options]\n\n"
        "The digital twin of a soft surface that arms bend. Needs no ROS.\n\n"
        f"verbs:\n{verbs}\n\n"
        "`ldcs <verb> --help` explains one verb, with an example. Start with:\n"
        "  ldcs simulate paper --duration 3 --bag out/first && ldcs plot out/first\n\n"
        "exit status: 0 done, 1 a check failed, 2 bad input, 130 interrupted"
    )


def _note(message: Warning | str, *_: object, **__: object) -> None:
    print(f"ldcs: note: {' '.join(str(message).split())}", file=sys.stderr)


def _complain(message: str) -> int:
    print(f"ldcs: error: {' '.join(message.split())}", file=sys.stderr)
    return EXIT_BAD_INPUT
