"""The ladder of models: which one is accurate enough for a scene, and at what cost."""
