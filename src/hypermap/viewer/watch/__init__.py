"""A map being made, in the browser: what each frame saw, and the map as it was then."""
