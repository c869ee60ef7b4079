"""`camopt tradeoff`: what accuracy costs, of every method and of every dial of the job."""
