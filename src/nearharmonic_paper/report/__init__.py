"""The page of results: one HTML file with claims, interactive figures and tables, which needs no network.

``page`` reads the folder and fills the template. ``energy_error``, ``decomposition``, ``perihelion``, ``phase_space``
and ``durations`` draw the interactive figures, on the panels that ``panels`` makes of bokeh's ``models``.
"""
