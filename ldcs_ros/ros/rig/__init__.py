"""The nodes of the rig: the bridge and the mock rig."""
