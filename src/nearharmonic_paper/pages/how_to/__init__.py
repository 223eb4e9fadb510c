"""Generated parts of the pages below docs/how_to/."""
