#!/bin/sh
# From the virtual bench to a calibrated actuator file: three tests of a unit whose friction and backlash the model does not know, calibrated together, validated on another log.
set -e
run() { elevon bench run "$@" --actuator torino-rotary --set drive.kind=pwm --set backlash.total=0.6deg \
    --set friction.dynamic=0.36N*m --set friction.static=0.45N*m; }
for test in backlash loaded chirp; do run $test --out logs; done
run backlash --seed 7 --out another
elevon calibrate logs/backlash.csv logs/loaded-?.csv logs/chirp.csv --actuator torino-rotary \
    --set drive.kind=pwm --out unit.toml
elevon validate another/backlash.csv --actuator unit.toml
