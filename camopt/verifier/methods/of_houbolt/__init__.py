"""What Houbolt's method alone reads: its elements, the matrices of their pieces, and MOTORI's explicit form."""
