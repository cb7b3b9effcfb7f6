"""C3D files: bytes, parameters, points and channels; read and written."""
