"""rclpy's names over the Cyclone DDS binding, for machines without ROS 2: what nodes use of it."""
