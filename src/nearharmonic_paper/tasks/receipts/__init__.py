"""Receipts of jobs, and the schema of the record that is assembled from them."""

from nearharmonic_paper.tasks.receipts.receipts import (
    BESIDE,
    MARKED,
    RUN,
    WHOLE,
    Receipt,
    damaged_receipts,
    folder_of,
    forget,
    identity,
    measured,
    measures_time,
    names_made_by,
    receipts_in,
)

__all__ = [
    "BESIDE",
    "MARKED",
    "RUN",
    "WHOLE",
    "Receipt",
    "damaged_receipts",
    "folder_of",
    "forget",
    "identity",
    "measured",
    "measures_time",
    "names_made_by",
    "receipts_in",
]
