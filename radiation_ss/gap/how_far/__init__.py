"""How far the gap shrinks on data that no fit has seen, and what a controller has of it."""
