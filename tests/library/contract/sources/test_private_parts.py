"""Only public names of other libraries are used, which their next version still has."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import nearharmonic

SOURCES = Path(nearharmonic.__file__).parents[1]
LIBRARIES = {"xr", "xarray", "np", "numpy", "pd", "h5py", "h5netcdf", "pydantic", "mpmath"}
#: Private names of methods and attributes of xarray's and h5netcdf's objects that were useful once.
INNER = {"_construct_direct", "_replace_with_new_dims", "_h5group", "_h5file", "_to_temp_dataset"}


def private_uses(text):
    """Names such as ``xr.Dataset._construct_direct`` in a text."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            root = node.value
            while isinstance(root, ast.Attribute):
                root = root.value
            if node.attr in INNER or (isinstance(root, ast.Name) and root.id in LIBRARIES):
                yield ast.unparse(node)


def test_a_private_name_is_recognised():
    text = "import xarray as xr\nxr.Dataset._construct_direct(1)\ngroup._h5group.create_dataset('x')\nself._own\n"
    assert list(private_uses(text)) == ["xr.Dataset._construct_direct", "group._h5group"]


@pytest.mark.slow
def test_no_module_uses_private_parts_of_a_library():
    found = {
        f"{path.relative_to(SOURCES)}: {name}"
        for path in SOURCES.glob("nearharmonic*/**/*.py")
        for name in private_uses(path.read_text(encoding="utf-8"))
    }
    assert not found
