"""Small dense systems in given buffers."""
