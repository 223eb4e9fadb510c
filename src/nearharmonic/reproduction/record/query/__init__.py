"""What results are asked: a table of single runs, conditions on its columns, and all that is known of one run."""
