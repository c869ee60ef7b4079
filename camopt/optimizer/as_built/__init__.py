"""The search for a cam that holds in a wanted share of the trains as built, and what is said of the one found."""
