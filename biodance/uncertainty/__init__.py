"""How wrong things are: elementary sources of error, frequency bands, learning, and the one table of sizes; nothing
else says it again.
"""
