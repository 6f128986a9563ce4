"""The twin: a simulation with sensors, commands, watchdog and recorder; it makes every message once, as bytes."""
