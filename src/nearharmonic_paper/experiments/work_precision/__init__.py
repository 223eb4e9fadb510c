"""Run time against error, for the methods of this package and for other libraries."""
