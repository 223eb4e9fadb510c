"""Checks of messages about bad input."""

import copy
from time import process_time

from nearharmonic.errors import LONGEST, NearharmonicError

#: Seconds of a case.
LIMIT = 2


def check_message(text, says=""):
    """One line, short, which holds the words ``says``."""
    assert text == text.strip()
    assert len(text.splitlines()) == 1, text
    assert len(text) <= LONGEST, text
    assert "Traceback" not in text
    assert says in text, text


def with_key(config, key, value):
    """A copy of ``config`` with the dotted ``key`` set to ``value``, or without it."""
    config = copy.deepcopy(config)
    *above, last = key.split(".")
    place = config
    for step in above:
        place = place.setdefault(step, {})
    if value == "<left out>":
        del place[last]
    else:
        place[last] = value
    return config


def refused(call, says=""):
    """The message of the error that ``call`` raises at once."""
    begin = process_time()
    try:
        call()
    except NearharmonicError as error:
        text = str(error)
    else:
        raise AssertionError("it is accepted")
    assert process_time() - begin < LIMIT
    check_message(text, says)
    return text
