"""Jobs on other computers: each gets a frozen description and does not read the workflow again."""
