"""Makes the data: the billet of truth.deck, cooled three times, each reading with an error of 2 K.

    python3 measure.py > measured.csv
"""

import random

import billet

noise = random.Random(1373)
cooled = list(billet.simulate(billet.read("truth.deck")))
print("replicate,place,time [s],temperature [K]")
for replicate in range(1, 4):
    for place in billet.PLACES:
        for time, temperature in cooled:
            print(f"{replicate},{place},{time:g},{temperature[place] + noise.gauss(0, 2):.2f}")
