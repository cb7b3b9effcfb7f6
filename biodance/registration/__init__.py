"""Where did the plates lie, and how late was their clock? FramePose and delay of a force recording of which neither is
known, from how the body moved.
"""
