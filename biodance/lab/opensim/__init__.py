"""OpenSim's text files: .trc markers, .mot and .sto tables, ground forces."""
