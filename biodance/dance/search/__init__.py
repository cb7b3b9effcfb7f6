"""The search for a dance: postures (words that people know, or optimised ones), their order, the moves, repairs."""
