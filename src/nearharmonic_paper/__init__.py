"""The paper and its record: configs, experiments, statements, the page of results, and the record of every run."""
