"""Content of the page for a result: figures, tables, legend, links, words."""
