"""The laboratory's window: a page of this machine alone that shows an archive, corrects session.toml and runs."""
