"""Subcommands that ask results and their record; see :mod:`nearharmonic.commands`."""
