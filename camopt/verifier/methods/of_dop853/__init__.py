"""What DOP853 alone reads: its own writing of the laws."""
