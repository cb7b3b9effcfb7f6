"""What a robot's laboratory recorded: joint encoders and a force plate, each with a clock of its own."""
