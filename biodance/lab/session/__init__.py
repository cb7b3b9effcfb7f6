"""One visit of one person: recordings in a folder, roles, subject, session.toml."""
