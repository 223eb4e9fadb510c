"""The page of results: one HTML file with claims, interactive figures and tables, which needs no network."""
