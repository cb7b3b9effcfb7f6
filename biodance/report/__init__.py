"""Figures and pages for the analyst and the subject. Computes nothing."""
