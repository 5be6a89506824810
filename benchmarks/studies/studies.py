"""Studies of this folder as scripts: their numbers, `--cluster`, and the `map` that shares out their tasks.

A task is a data set, or a case with a seed of its own, so that what is printed does not depend on who does
it. Workers find a study by the name of its module: those of `--cluster local` have the path of the script;
others need this folder of the same revision in their `PYTHONPATH`.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from evenlight.cluster import HELP, opened_map
from evenlight.data_schema.errors import InputError
from evenlight.method.one_blas_thread import one_blas_thread

Mapped = Callable[..., Iterable[Any]]


def run_study(
    script: str,
    declare: Callable[[argparse.ArgumentParser], object] = lambda parser: None,
    **numbers: int,
) -> None:
    """Call `main` of a script with what the command line says, and a `map`.

    Parameters
    ----------
    script : str
        Its `__file__`. It is imported by its name: workers do not know the functions of `__main__`.
    declare : callable, optional
        Adds arguments to the parser.
    **numbers : int
        Arguments that are counts, in order, with their defaults.
    """
    study = importlib.import_module(Path(script).stem)
    parser = argparse.ArgumentParser(description=study.__doc__)
    for name, default in numbers.items():
        parser.add_argument(name, type=int, nargs="?", default=default)
    declare(parser)
    parser.add_argument("--cluster", metavar="NAME|ADDRESS", help=HELP)
    asked = vars(parser.parse_args())
    try:
        with opened_map(asked.pop("cluster"), quiet=False) as mapped:
            one_blas_thread(study.main)(mapped=mapped, **asked)  # as Dask's workers have
    except InputError as error:
        parser.error(str(error))
