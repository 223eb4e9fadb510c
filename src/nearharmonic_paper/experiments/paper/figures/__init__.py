"""Figures of the paper, one module each: functions that draw Datasets, without computations."""
