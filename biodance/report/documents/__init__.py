"""JSON documents: keys whose unit is their suffix."""
