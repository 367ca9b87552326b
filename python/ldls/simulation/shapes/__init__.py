"""Shapes of what stands in a scene, each at its own origin on the ground: x ahead, y left, z up, metres."""
