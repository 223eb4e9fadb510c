"""A folder of results as one zip file that can be read without this package: an RO-Crate, sealed by its digest."""
