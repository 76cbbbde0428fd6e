"""The questions that `verify` puts to a dataset, by what they look at: its own word, its rows, its videos."""
