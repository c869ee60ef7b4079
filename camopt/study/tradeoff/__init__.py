"""`camopt tradeoff`: the cost of accuracy for every method and every dial of the job."""
