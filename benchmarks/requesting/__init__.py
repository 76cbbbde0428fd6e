"""How well a language model answers what the agents ask: requests on scenes of the twin, and what became of each."""
