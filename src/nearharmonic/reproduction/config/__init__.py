"""The config of the workflow: its types, and the schema that follows from them."""
