"""Postures: found, exchanged, chosen, put in order."""
