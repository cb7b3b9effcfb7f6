"""Figures: drawn from results, nothing computed."""
