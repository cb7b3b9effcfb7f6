"""AMTI's native recordings: NetForce's .bsf and its text exports."""
