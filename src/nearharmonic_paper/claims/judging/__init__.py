"""Judgement of numbers: curves and their ranges, local slopes, margins, general words."""
