"""Systems that users define in Python files of their own."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from nearharmonic.errors import NearharmonicError, SystemDefinitionError
from nearharmonic.systems import System


def load_system(path: Path) -> System:
    """Return the ``SYSTEM`` that the Python file ``path`` defines.

    Raises
    ------
    SystemDefinitionError
        There is no such file, it cannot be run, or it defines no System of that name.
    """
    if not path.is_file():
        message = f"{path}: no such file. A system of your own is a Python file that defines SYSTEM"
        raise SystemDefinitionError(message)
    spec = importlib.util.spec_from_file_location(f"nearharmonic_user_{path.stem}", path)
    if spec is None or spec.loader is None:
        message = f"{path} is no Python file: its name must end in .py"
        raise SystemDefinitionError(message)
    module: ModuleType = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except NearharmonicError:
        raise
    except Exception as error:
        message = f"{path} cannot be run: {type(error).__name__}: {error}"
        raise SystemDefinitionError(message) from error
    found = getattr(module, "SYSTEM", None)
    if not isinstance(found, System):
        message = f"{path} does not define SYSTEM, a nearharmonic.systems.System; it has {found!r}"
        raise SystemDefinitionError(message)
    return found
