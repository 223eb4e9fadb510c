"""Result files in HDF5 with netCDF-4 conventions, bitwise identical for identical numbers."""

from nearharmonic.output.store.files import as_written, attributes_of, claimed_attributes, foreign_in, groups_of
from nearharmonic.output.store.reader import read, read_precisions
from nearharmonic.output.store.remake import DEFAULT_CONFIG, command_for, unusable, usable_configs, workflow_command
from nearharmonic.output.store.seal import sealed_digest
from nearharmonic.output.store.writer import write, write_dataset

__all__ = [
    "DEFAULT_CONFIG",
    "as_written",
    "attributes_of",
    "claimed_attributes",
    "command_for",
    "foreign_in",
    "groups_of",
    "read",
    "read_precisions",
    "sealed_digest",
    "unusable",
    "usable_configs",
    "workflow_command",
    "write",
    "write_dataset",
]
