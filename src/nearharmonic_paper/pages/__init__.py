"""Generated parts of pages below docs/, one module a page, each between marks that its text has.

A function ``page`` is the task of a rule of ``workflow/rules/pages.smk``. It takes the path of the page, the names of
all systems and integrators that are looked up, and the paths of what it reads. It returns the page with its parts
filled in, and its pictures. ``parts`` returns the parts alone, by their marks.
"""
