"""One session through all stages, from read to exported; a step that fails is a status with a reason."""
