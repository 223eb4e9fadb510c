"""Methods of the comparison, and intervals by resampling."""
