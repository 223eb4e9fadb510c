"""The paper and its record: configs, experiments, statements, the page of results, and what is known of every run."""
