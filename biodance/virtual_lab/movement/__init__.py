"""What the person does: protocol, postures, balance, the true motion and wrench."""
