"""What is hidden in a recording, made without the formulas that find it."""
