"""The twin's face to the outside: topics, messages as CDR bytes, commands, watchdog. No rclpy here."""
