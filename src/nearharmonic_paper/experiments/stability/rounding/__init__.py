"""Growth of round-off over long times."""
