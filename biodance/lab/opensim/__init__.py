"""OpenSim's text files: .trc markers, .mot and .sto tables, ground forces."""

import numpy as np

Y_UP_TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""(3, 3) lab_R_file of a Y-up recording (OpenSim: x forward, y up, z right): x stays, y becomes z, z becomes -y."""
