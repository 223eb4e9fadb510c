"""Targets of the workflow: a name that no rule has ends with the nearest match before any work."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable, Collection, Iterable
from functools import wraps
from typing import Any

from nearharmonic.errors import NearharmonicError, bad_setting, unknown_name

#: Allowed values of a wildcard, in the name of a file.
_CONSTRAINT = re.compile(r",[^}]*\}")

#: Former names of targets, which warn, and their present names.
FORMER = {"beyond": "sixth_order"}


def check_first(workflow: Any, files: Callable[[], Iterable[str]], refuse: Callable[[NearharmonicError], Any]) -> None:
    """Let ``workflow`` execute only if its targets exist; Snakemake knows them after the rules alone.

    Parameters
    ----------
    workflow : snakemake.workflow.Workflow
        The workflow, with all its rules.
    files : callable
        As for :func:`check_targets`.
    refuse : callable
        Function that ends the process with the message of an error.
    """
    execute = workflow.execute

    @wraps(execute)
    def checked(*arguments: Any, **settings: Any) -> Any:
        try:
            check_targets(workflow.dag_settings.targets, workflow.rules, files)
        except NearharmonicError as error:
            refuse(error)
        return execute(*arguments, **settings)

    if workflow.is_main_process:
        workflow.execute = checked


def check_targets(targets: Iterable[str], rules: Collection[Any], files: Callable[[], Iterable[str]]) -> None:
    """Raise an error for the first target that is neither a rule nor a file that a rule makes; warn of former names.

    Parameters
    ----------
    targets : iterable of str
        Names of rules and files, as they are on the command line.
    rules : collection of snakemake.rules.Rule
        All rules.
    files : callable
        Function that returns the files that can be made, for the nearest match; it is called for an error alone.

    Raises
    ------
    UnknownNameError
        The message holds the target, the nearest match, and the rules that are targets.
    SettingError
        The target is a rule that makes one of many files, whose name the target has to be.
    """
    named = {rule.name: rule for rule in rules}
    for target in targets:
        if target in FORMER:
            warnings.warn(f"the target {target} is now {FORMER[target]}", FutureWarning, stacklevel=2)
        if target in named:
            if named[target].has_wildcards():
                file = _CONSTRAINT.sub("}", str(next(iter(named[target].output))))
                raise bad_setting("target", target, f"a file of this rule, {file}")
        elif not any(rule.is_producer(os.path.relpath(target)) for rule in rules):
            known = files() if os.sep in target else [name for name, rule in named.items() if not rule.has_wildcards()]
            raise unknown_name("target", target, known)
