"""Robots: HOAP-3 of the paper, any humanoid from its URDF file."""
