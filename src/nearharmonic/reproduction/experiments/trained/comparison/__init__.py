"""Which methods are compared, and intervals by resampling."""
