"""Force plates of C3D files: from raw channels to wrenches about the lab origin, every decision a sentence."""
