"""What it weighs: base parameters, SIP programmes, uncertainty, added mass, cross-validation."""
