"""Sessions whose truth is known: subject, motion, soft tissue, instruments, faults, written as C3D files."""
