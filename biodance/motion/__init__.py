"""How it moved: inverse kinematics, smoothing, regressor and dynamics, contact wrench and ZMP."""
