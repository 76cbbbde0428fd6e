"""The four agents, the loop that connects them, and what they remember (ManiAgent, section III)."""
