"""Generated parts of pages below docs/: each stands between marks, and the numbers of a page are in its text.

A page has one function, which is the task of a rule of ``workflow/rules/pages.smk``. It takes what the page is made of,
and returns its parts by their marks, and pictures by the names of outputs. :func:`filling.fills` does the rest. What is
measured for one page alone is a command below ``benchmarks/``.
"""
