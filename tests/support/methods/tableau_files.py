"""Files of coefficients from elsewhere, each with its source: published, from libraries, or damaged."""

from functools import cache
from pathlib import Path

from nearharmonic.exchange.files import read
from nearharmonic.exchange.verdict import Verdict

FOLDER = Path(__file__).parents[2] / "library/exchange/tableaus"


def path(kind, name):
    """The path of a file by its kind (a folder) and its name without the ending."""
    (found,) = (FOLDER / kind).glob(f"{name}.*")
    return str(found)


def names(kind):
    return sorted(one.stem for one in (FOLDER / kind).iterdir())


@cache
def verdict(kind, name):
    return Verdict(read(path(kind, name)))


def failing(found):
    """The claims of a verdict that do not hold, without their values."""
    return [claim.says.partition(" ")[0] for claim in found.claims if not claim.holds]
