"""Methods that are compared, and intervals by resampling."""
