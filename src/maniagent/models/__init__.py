"""How chat models are reached: questions with pictures in, validated answers out, every call within a budget."""
