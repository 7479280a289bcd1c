"""Active tension of muscles: its dependence on length and on the rate of length."""
