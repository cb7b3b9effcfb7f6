"""One session through all stages: read, prepared, scaled, tracked, compared. A step that fails is a status with a
reason.
"""
