"""The subcommands of ``nearharmonic``: one module each, of the command's name, an underscore standing for a hyphen.

A module has ``HELP``, one line; ``arguments(parser)``, which adds its arguments to an ``argparse`` parser; and
``answer(chosen)``, which takes what was parsed and returns a :class:`nearharmonic.output.answers.Answer`. Nothing
else refers to it. A module loads what is slow to load inside ``answer``, because ``nearharmonic --help`` imports all of
them.
"""
