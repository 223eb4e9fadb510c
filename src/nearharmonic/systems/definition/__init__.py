"""What a system is: declaration, arguments, quantities with units."""
