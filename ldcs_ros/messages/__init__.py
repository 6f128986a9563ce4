"""The interface of the twin: topics and messages as CDR bytes, without rclpy."""
