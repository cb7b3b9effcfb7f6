"""Inverse kinematics, functional calibration, closed legs; compiled where it runs frame by frame."""
