"""A recorded run, carried out again from its folder: the same decisions, without a robot, a simulator or a network."""
