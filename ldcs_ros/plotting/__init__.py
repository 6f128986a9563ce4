"""Pictures of a Recording: the surface, the points, the drives, the motion. Needs a bag, not a simulation.

bag -> Recording -> tracks (arrays in SI units) -> surface / points / drives / motion -> PNG, GIF, MP4
"""
