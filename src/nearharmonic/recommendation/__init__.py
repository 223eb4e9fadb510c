"""Choice of a method for an error bound."""
