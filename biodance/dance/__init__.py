"""How to move to become known: excitation criteria, postures, transitions, balance."""
