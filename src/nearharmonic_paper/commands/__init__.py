"""Subcommands for queries of results and their record; see :mod:`nearharmonic.commands`."""
