"""Messages for displays: markers of surface, loads, arms and traces."""
