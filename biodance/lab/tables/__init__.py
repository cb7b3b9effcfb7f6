"""Tables of markers and forces as laboratories and data sets publish them: CSV, TSV, Parquet."""
