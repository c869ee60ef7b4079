"""`camopt reduce`: smaller models of a scene, with what each gets wrong and saves."""
