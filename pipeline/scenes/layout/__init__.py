"""Plans of scenes: where roads, houses, plants, cars and people are, and how they move."""
