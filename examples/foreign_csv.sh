#!/bin/sh
# From a logger's CSV to a validated actuator file: SQUARES.csv SWEEP.csv ANOTHER.csv, with drive.toml (the
# numbers of the datasheets) beside them. Read map.toml before you trust it.
set -e
elevon import "$1" --guess map.toml
elevon import "$1" --map map.toml --out imported.parquet
elevon calibrate "$1" "$2" --map map.toml --actuator drive.toml --out fitted.toml
elevon validate "$3" --map map.toml --actuator fitted.toml
