"""The compiled kernels of the search are found again on disk only for the sources that they were compiled from."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import nearharmonic as nh
from nearharmonic.experiments.sixth_order.kernels import kernels

#: Loads the search's kernels from each package given, with a compiler that refuses to work: says which were on disk.
ON_DISK = """
import sys
import numba.core.compiler, numba.core.dispatcher

class Compiles(BaseException):
    pass

def refuse(*arguments, **settings):
    raise Compiles

numba.core.compiler.compile_extra = refuse
for root in sys.argv[1:]:
    for name in [name for name in sys.modules if name.partition(".")[0] == "nearharmonic"]:
        del sys.modules[name]
    sys.path.insert(0, root)
    from nearharmonic.experiments.sixth_order import kernels
    assert kernels.__file__.startswith(root)
    try:
        kernels.kernels()
    except Compiles:
        print("compiles")
    else:
        print("on disk")
"""


def test_an_edit_of_the_search_or_of_its_criterion_compiles_the_kernels_of_the_search_again(tmp_path):
    kernels()  # in the cache from here on, if no other test has put them there
    roots = []
    for module in (None, "compiled_text", "criterion", "kernels"):
        roots.append(tmp_path / str(module))
        package = roots[-1] / "nearharmonic"
        shutil.copytree(Path(nh.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
        if module:
            with (package / f"experiments/sixth_order/{module}.py").open("a", encoding="utf-8") as file:
                file.write("\nEDITED = 1\n")
    done = subprocess.run(
        [sys.executable, "-c", ON_DISK, *map(str, roots)],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONPATH": ""},
    )  # fmt: skip
    assert done.stdout.split("\n")[:-1] == ["on disk", "compiles", "compiles", "compiles"]
