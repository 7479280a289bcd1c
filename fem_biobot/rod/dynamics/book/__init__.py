"""What a step is entered with."""
