"""The sessions of one laboratory judged together: what is the plate's, what the person's, what everybody's."""
