"""Files that the package writes, whatever their content."""
