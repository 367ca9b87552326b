"""ROS messages and bags: one module a message, readers and a writer of bags. Needs the extra `ros` where it is used."""
