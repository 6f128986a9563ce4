"""The output stage: a small process that alone holds a rig's device. It imports neither NumPy nor rclpy.

bridge -> set-points with epoch and time -> OutputLimiter -> Device -> rig
rig -> Device -> WriteMonitor (read-back, acknowledgement, limit) -> vent; readings and raw packets -> bridge
"""
