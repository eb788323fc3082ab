"""The paper's experiments, each beside its published numbers."""
