"""What the page shows of a result: figures, tables, legend, links, words."""
