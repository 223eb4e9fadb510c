"""Plots of the kinds of Datasets that functions of the package return, and the legend that they share."""
