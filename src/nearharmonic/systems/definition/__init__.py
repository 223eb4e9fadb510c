"""Definition of a system: declaration, arguments, quantities with units."""
