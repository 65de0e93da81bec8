"""The virtual rig as a rig of the blind benchmark."""
