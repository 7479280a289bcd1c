"""Direct solver for the small, chain-like systems of an assembly: 6 by 6 blocks, eliminated in a planned order."""
