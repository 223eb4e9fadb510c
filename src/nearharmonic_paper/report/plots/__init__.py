"""The interactive plots of the page, one module for each kind of figure, as documents of bokeh."""
