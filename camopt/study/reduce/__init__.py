"""`camopt reduce`: smaller models of a scene, with their errors and savings."""
