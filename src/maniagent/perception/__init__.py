"""RGB-D images to objects in 3-D with grasps; no weights, no true state."""
