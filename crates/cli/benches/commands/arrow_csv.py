"""Seconds that Arrow's CSV reader takes on one thread for each file named on standard input."""

import sys
import time

import pyarrow
from pyarrow import csv

pyarrow.set_cpu_count(1)
for line in sys.stdin:
    begin = time.perf_counter()
    csv.read_csv(line.strip(), read_options=csv.ReadOptions(use_threads=False))
    print(time.perf_counter() - begin, flush=True)
