"""FAMILY of data files: tables of segment parameters in one tidy schema, a user's own, and the prior made of them."""
