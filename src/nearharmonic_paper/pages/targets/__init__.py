"""Generated parts of pages on what one target of the workflow measures."""
