"""What is proved of a tableau without integrating: error terms, orders, and limits of linear stability."""
