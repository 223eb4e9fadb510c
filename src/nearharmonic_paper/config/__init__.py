"""The config of the workflow: its types, and the schema that is generated from them."""
