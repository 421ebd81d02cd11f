"""Makes the Parquet files beside it, each by another program, of the same columns.

pip install duckdb numpy pandas polars pyarrow && python make_parquet.py
"""

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

N = 300
k = np.arange(N)
time = k / 128
force = ((k * k) % 7 - 3) * 0.1
x = (k * 0.3).astype(np.float32)
count = (k * 7 - 900).astype(np.int32)

# Three row groups, two pages each, plain and by a dictionary; a column with a null, one of text, and
# one of lists; units and a rate among the keys.
table = pa.table(
    {
        "time": time,
        "force": force,
        "x": x,
        "count": count,
        "unsigned": (k + 4_294_966_000).astype(np.uint32),
        "holed": pa.array([None if i == 4 else float(i) for i in k]),
        "note": ["word"] * N,
        "list": [[1.0, 2.0]] * N,
        "stamp": pa.array(1_700_000_000_000_000_000 + k * 7_812_500, pa.timestamp("ns")),
    }
).replace_schema_metadata({"units": '{"force": "mN", "x": "mm"}', "sample_rate_hz": "128"})
pq.write_table(table, "pyarrow.parquet", row_group_size=128, data_page_size=512, compression="snappy")
frame = pd.DataFrame({"time": time, "force": force, "x": x, "count": count})
frame.attrs = {"units": {"force": "mN", "x": "mm"}}
frame.to_parquet("pandas.parquet", compression="gzip")
pl.from_pandas(frame).write_parquet("polars.parquet", compression="zstd")
duckdb.sql("COPY frame TO 'duckdb.parquet' (FORMAT parquet)")

# Three records of 100, 120 and 80 rows in five row groups; one sample of the second is not a number.
lengths = [100, 120, 80]
broken = force.copy()
broken[150] = np.nan
many = pa.table(
    {
        "machine": np.repeat(["pump 1", "pump 2", "fan"], lengths),
        "day": np.repeat(np.array([7, 8, 9], dtype=np.int32), lengths),
        "again": np.repeat([1, 2, 1], lengths),
        "named": pa.array([None if i == 5 else "a" for i in k]),
        "stamp": pa.array(1_700_000_000_000_000_000 + k * 7_812_500, pa.timestamp("ns")),
        "force": broken,
        "x": x,
    }
)
pq.write_table(many, "many.parquet", row_group_size=64, data_page_size=128, use_dictionary=["machine", "force"])
