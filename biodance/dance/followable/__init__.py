"""A dance that people can follow: words that they know, all postures they make, a walk through them."""
