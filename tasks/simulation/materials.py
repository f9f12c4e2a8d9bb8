"""What surfaces of a simulated storey are made of, as far as a depth sensor cares."""

MATERIALS = ("matt", "dark", "glass")
"""Names of the materials; the index is the code of a triangle. Matt scatters the sensor's light
back, dark swallows much of it, glass lets nearly all of it through."""
MATT, DARK, GLASS = range(len(MATERIALS))
