"""What the instruments of the virtual laboratory record of it."""
