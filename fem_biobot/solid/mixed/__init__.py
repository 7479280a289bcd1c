"""The mixed form of the solid: a pressure of its own beside the displacement, for bodies that hardly change volume."""
