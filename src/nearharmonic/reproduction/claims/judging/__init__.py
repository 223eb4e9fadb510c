"""How numbers are judged: curves and their ranges, local slopes, margins, general words."""
