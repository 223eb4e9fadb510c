"""Cubes that each figure of the experiment is drawn from by the tests of all figures, and variables that stay."""

from support.cubes import figure_cubes as made

EXAMPLES = {"trained_error": (made.contest, ()), "trained_gain": (made.contest, ()), "trained_ideas": (made.ideas, ())}
