"""biodance: segment inertial parameters of a person, measured from markers and force plates instead of read from a table."""

__version__ = "0.1.0"
