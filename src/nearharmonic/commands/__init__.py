"""The subcommands of ``nearharmonic``: one module each, of the command's name, an underscore standing for a hyphen.

A module has ``HELP``, one line; ``arguments(parser)``, which adds its arguments to an ``argparse`` parser; and
``answer(chosen)``, which returns a :class:`nearharmonic.output.table.Answer` for the parsed arguments. No other
module refers to it. Slow imports are inside ``answer``, because ``nearharmonic --help`` imports all modules.
"""
