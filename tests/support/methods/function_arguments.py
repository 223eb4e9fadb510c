"""Arguments for the functions of formulas, where they are hard to evaluate among them, and their values."""

from functools import cache

import gmpy2
import numpy as np

from nearharmonic.core.functions import ELEMENTWISE, double, elementwise, extended
from nearharmonic.core.native import loaded, processor

#: Where functions change their form or leave the range of doubles.
SPECIAL = np.array([
    0.0, -0.0, np.inf, -np.inf, np.nan, 1, -1, 2, -2, 0.5, -0.5, 2.5, 3, -3, 5e-324, -5e-324, 2.2250738585072014e-308,
    1e-310, 1.7976931348623157e308, -1.7976931348623157e308, 2.0**52 + 1, 2.0**53, -(2.0**52) - 1, 1 + 2.0**-52,
    1 - 2.0**-53, 2.0**20, 0.55, -0.55, 2.0**-27, 709.782712893384, 709.7827128933841, -745.1332191019411,
    -745.1332191019412, 710.4758600739439, 6.0, 9.0, 1e22,
])  # fmt: skip
#: The double nearest to a multiple of pi/2, relative to it: 6381956970095103 * 2^797 (Muller et al., Handbook, 11.3).
NEAREST_TO_A_MULTIPLE = 6381956970095103 * 2.0**797


def any_doubles(random, count):
    """Finite doubles whose bit patterns are uniform."""
    numbers = random.integers(0, 2**64, 2 * count, dtype=np.uint64).view(np.float64)
    return numbers[np.isfinite(numbers)][:count]


def multiples_of_half_pi(random, count, largest=2**61):
    """Doubles next to whole multiples of pi/2, and what the multiples exceed them by, in random order of size."""
    factors = [
        int(k) >> int(s) for k, s in zip(random.integers(1, largest, count), random.integers(0, 60, count), strict=True)
    ]
    with gmpy2.context(precision=400):
        exact = [gmpy2.const_pi() / 2 * k for k in factors]
        high = [float(x) for x in exact]
        low = [float(x - gmpy2.mpfr(h)) for x, h in zip(exact, high, strict=True)]
    return np.array(high), np.array(low)


def spread(random, count, least, most):
    """Numbers of both signs whose exponents to the base ten are uniform."""
    return 10 ** random.uniform(least, most, count) * random.choice([-1, 1], count)


def _angles(random, n):
    near = multiples_of_half_pi(random, n)[0]
    parts = [
        any_doubles(random, n),
        random.uniform(-10, 10, n),
        random.uniform(-1e6, 1e6, n),
        spread(random, n, -20, 20),
    ]
    return [*parts, near, np.nextafter(near, np.inf), np.nextafter(near, 0), [NEAREST_TO_A_MULTIPLE]]


def _exponents(random, n):
    ends = [random.uniform(709.7, 709.8, n), random.uniform(-745.2, -708, n), random.uniform(-1, 1, n)]
    return [random.uniform(-750, 712, n), *ends, spread(random, n, -20, -1), any_doubles(random, n)]


def _near_one(random, n):
    return 1 + spread(random, n, -16, -1)


SINGLE = {
    "sin": _angles, "cos": _angles, "tan": _angles, "exp": _exponents,
    "log": lambda r, n: [abs(any_doubles(r, n)), _near_one(r, n), r.uniform(0, 10, n), r.uniform(0.7, 1.42, n)],
    "cbrt": lambda r, n: [any_doubles(r, n), r.uniform(-10, 10, n), np.arange(-40.0, 40) ** 3],
    "sinh": lambda r, n: [*_exponents(r, n), r.uniform(-2, 2, n), r.uniform(710.4, 710.5, n)],
    "cosh": lambda r, n: [*_exponents(r, n), r.uniform(-2, 2, n), r.uniform(710.4, 710.5, n)],
    "tanh": lambda r, n: [r.uniform(-25, 25, n), r.uniform(-1, 1, n), spread(r, n, -20, 0), any_doubles(r, n)],
    "erf": lambda r, n: [r.uniform(-7, 7, n), r.uniform(-1.2, 1.2, n), spread(r, n, -20, 0), any_doubles(r, n)],
}  # fmt: skip


def _powers(random, n):
    base, other = 10 ** random.uniform(-5, 5, n), abs(any_doubles(random, n))
    near = abs(_near_one(random, n))
    ends = random.uniform(-1080, 1026, n)  # exponents of two of the results: both ends of the range
    whole = -random.integers(1, 100, n).astype(float), random.integers(-150, 150, n).astype(float)
    with np.errstate(all="ignore"):
        rows = [(base, ends / np.log2(base)), (near, ends / np.log2(near)), (other, random.uniform(-3, 3, n))]
        rows += [(10 ** random.uniform(-2, 2, n), random.uniform(-20, 20, n)), whole]
    return [np.nan_to_num(np.concatenate(column)) for column in zip(*rows, strict=True)]


def _points(random, n):
    a, b = any_doubles(random, n), any_doubles(random, n)
    near = spread(random, n, -300, 300)
    rows = [(a, b), (near, near * spread(random, n, -8, 8)), (random.standard_normal(n), random.standard_normal(n))]
    rows += [
        (spread(random, n, -323, -300), spread(random, n, -323, -300)),
        (near, near * (1 + spread(random, n, -16, -1))),
    ]
    rows += [(spread(random, n, 307, 308.2), spread(random, n, 307, 308.2))]
    base = spread(random, n, -5, 5)
    rows += [(base * spread(random, n, -308, -290), base)]  # angles whose low halves are near underflow
    return [np.concatenate(column) for column in zip(*rows, strict=True)]


DOUBLE = {"pow": _powers, "atan2": _points, "hypot": _points}


def arguments(name, count, seed=1):
    """Rows of about ``count`` arguments in random order, the special ones among them."""
    random = np.random.default_rng(seed)
    if name in SINGLE:
        parts = SINGLE[name](random, 1)
        rows = [np.concatenate(SINGLE[name](random, max(1, count // len(parts))))]
        special = [SPECIAL]
    else:
        rows = DOUBLE[name](random, max(1, count // len(DOUBLE[name](random, 1)[0])))
        special = [grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL)]
    order = random.permutation(len(rows[0]) + len(special[0]))
    return [np.concatenate(pair)[order] for pair in zip(rows, special, strict=True)]


def pairs(name, count, seed=1):
    """Rows of high and low halves: low halves of all sizes up to half an ulp, some of them 0."""
    random = np.random.default_rng(seed)
    result = []
    for high in arguments(name, count, seed):
        with np.errstate(all="ignore"):
            low = (
                np.spacing(abs(high))
                * random.uniform(-0.5, 0.5, len(high))
                * 2.0 ** random.choice([0, 0, 0, -30], len(high))
            )
            low[(high + low != high) | ~np.isfinite(low) | (random.random(len(high)) < 0.1)] = 0
        result += [high, low]
    if name in ("sin", "cos", "tan"):
        near = multiples_of_half_pi(random, max(50, count // 10))
        result = [np.concatenate(columns) for columns in zip(result, near, strict=True)]
    return result


@cache
def in_double(name):
    return lambda *x: [double.FUNCTIONS[name](*x)]


@cache
def in_extended(name):
    return lambda *x: extended.FUNCTIONS[name](*zip(x[::2], x[1::2], strict=True))


def compiled(body, count, width, results=1):
    """The function of ``count`` rows of arguments that compiled code of ``width`` lanes is."""
    code = _loaded(body, count, width, processor())

    def function(rows):
        given = np.ascontiguousarray(rows)
        found = np.empty((results, given.shape[1]))
        code(given, found)
        return found

    return function


@cache
def _loaded(body, count, width, _processor):
    """Compiled once for each processor."""
    return loaded(*elementwise(body, count, width), ELEMENTWISE)


def evaluated(body, rows, width, results=1):
    """Results of compiled code of ``width`` lanes for rows of arguments."""
    return compiled(body, len(rows), width, results)(rows)


def same_bits(a, b):
    return (a.view(np.int64) == b.view(np.int64)) | (np.isnan(a) & np.isnan(b))
