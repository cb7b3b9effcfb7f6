"""What the lab recorded: one reader per format, force plates, marker sets, gaps and filters. The only room that
converts units.
"""
