"""Which effects a recording calls for, and how strong they are: likelihoods of a scene with and without each."""
