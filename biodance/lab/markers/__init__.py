"""Marker sets, and gaps in trajectories."""
