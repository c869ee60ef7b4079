"""What the experiments share: records with their provenance, drawn scenes, fixed problems, and figures."""
