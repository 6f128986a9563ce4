"""The bridge to a rig: transports, the gate that every command passes, residuals and diagnostics. No rclpy here.

rig -> Transport -> Reading -> Intake (checks, clocks) -> Follower (the twin beside the rig) -> residuals, bag
operator -> Gate (arming, limits, slew, watchdog) -> Transport (limits, slew, watchdog once more) -> rig
"""
