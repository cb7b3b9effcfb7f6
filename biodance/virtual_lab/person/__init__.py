"""The virtual person: true skeleton, flesh and markers."""
