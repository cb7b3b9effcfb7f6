"""Which frames are fully measured: soles, plates, surfaces."""
