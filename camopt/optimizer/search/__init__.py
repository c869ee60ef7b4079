"""The search for a cam: its judge, its stages, its journal, and judges that let the train be off."""
