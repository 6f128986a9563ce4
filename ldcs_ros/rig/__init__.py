"""The bridge to a rig: transports, the gate that every command passes, residuals and diagnostics. No rclpy here.

rig -> Link -> RawReading -> ReadingValidator (checks, clocks) -> Reading -> Follower (the twin beside the rig)
operator -> Gate (arming, limits, slew, watchdog) -> Link -> output process (the same once more) -> rig
"""
