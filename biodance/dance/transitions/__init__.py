"""Moves between postures: found one by one, planned for a whole dance, planned again where one is impossible."""
