"""What touches: joint limits and contacts as inequality rows, their impulses and the events of a step."""
