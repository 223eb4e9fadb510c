"""Figures of run time against error: each system, all libraries, and regularised equations."""
