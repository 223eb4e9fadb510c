"""Programs that an export writes: compiled, run, and what they print."""

import re
import subprocess
from fractions import Fraction
from functools import cache

import nearharmonic as nh
from nearharmonic.exchange.files import export
from nearharmonic.integrators import integrators

#: Those of the examples.
TAU, STEPS = 0.25, 80
#: Neighbours of this orbit part by a factor e in ten units of time, and the examples take twenty.
GROWTH = 7.4
NUMBER = r"-?\d+\.\d+(?:[eE][-+]?\d+)?"


@cache
def ours(name, precision):
    """Position and momentum behind the steps of the examples, exactly as the two parts of each number say."""
    ran = nh.integrate("henon_heiles", name, tau=TAU, t_end=20, precision=precision)
    assert ran.steps == STEPS
    parts = [(ran.q, ran.q_low), (ran.p, ran.p_low)]
    return [
        Fraction(float(a)) + Fraction(float(b)) for high, low in parts for a, b in zip(high[-1], low[-1], strict=True)
    ]


def check(name, printed, precision="double"):
    """Compare with our state, to the rounding of the program.

    Each of its substeps adds to numbers below 1 and is off by half a unit in the last place, 2^-54, at most twice: of
    the sum, and of the product, which the step makes smaller. What is off grows as neighbours part.
    """
    substeps = STEPS * (2 * integrators[name].stages + 1)
    tolerance = substeps * GROWTH * 2.0 ** {"double": -53, "extended": -104}[precision]
    found = state(printed)
    assert len(found) == 4
    assert [abs(x - y) <= tolerance for x, y in zip(found, ours(name, precision), strict=True)] == [True] * 4


def run(words, folder):
    """Output of a command in ``folder``; it must succeed without other output, such as a warning."""
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
