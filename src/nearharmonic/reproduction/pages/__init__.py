"""Generated parts of pages below docs/, one module a page, each between marks that its text has.

A function ``page`` is the task of a rule of ``workflow/rules/pages.smk``. It takes the path of the page, and returns
the page with its parts filled in. ``parts`` returns the parts alone, by their marks.
"""
