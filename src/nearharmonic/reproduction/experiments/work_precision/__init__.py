"""Run time against error, for the methods of this package and for other libraries."""

#: Names of its cubes.
CUBES = ("work_precision",)
