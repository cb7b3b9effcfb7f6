"""What the simulation gets wrong: show it, name the cause, say how sure, measure what naming it gains."""
