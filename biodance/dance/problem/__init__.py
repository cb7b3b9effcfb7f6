"""The problem of a dance: coordinates, feet, forces and slopes, what a movement is worth, what is asked."""
