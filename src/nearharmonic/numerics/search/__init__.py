"""Parts of every search for solutions: the iteration from many points, and the distinct ones among its ends."""
