"""What lies on the sensor: frames to classes, in every runtime, and how well."""
