"""The ROS 2 nodes: thin adapters around the twin, and the only place that imports rclpy."""
