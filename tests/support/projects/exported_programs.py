"""Programs that an export writes: compiled, run, and what they print."""

from __future__ import annotations

import re
import subprocess
from fractions import Fraction

from nearharmonic.exchange.export import export
from nearharmonic.integrators import integrators

NUMBER = r"-?\d+\.\d+(?:[eE][-+]?\d+)?"


def run(words, folder):
    """What a command prints in ``folder``; it must succeed and say nothing else, such as a warning."""
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def written(folder, name, to, suffix, digits=None):
    """The file of an export of the integrator ``name`` to ``to``."""
    path = folder / f"{name}.{suffix}"
    path.write_text(export(integrators[name], to, digits), encoding="utf-8")
    return path


def state(printed):
    """The numbers that an example prints, q and then p, exactly."""
    lines = printed.split("\n")
    assert lines[0].startswith("q =")
    assert lines[1].startswith("p =")
    return [Fraction(number) for number in re.findall(NUMBER, printed)]


def array(text, name):
    """The numbers of an array of a program: those between its name, an opening bracket and the closing one."""
    (body,) = re.findall(rf"\b{name}\b[^\n=]*= [\[({{](?:real\(real_kind\) ::)?([^])}}]*)[\])}}]", unwrapped(text))
    return re.findall(NUMBER, body)


def unwrapped(text):
    """``text`` without the words that SUNDIALS puts around each number."""
    return re.sub(r"SUN_RCONST\(([^)]*)\)", r"\1", text)
