"""One schema for each result: what programs get of it (JSON, CSV, Parquet) and what people see (page, terminal)."""
