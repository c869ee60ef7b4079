"""How many trains as built hold the limits: draws, motions, the share and what spoils it."""
