"""The walker of the published open rod code, rebuilt from its numbers."""
