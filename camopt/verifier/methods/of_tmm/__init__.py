"""What the transition matrix method alone reads: the matrices of one step."""
