"""Reading and writing of files, independent of their content."""
