/* Made by `ril topic generate` from Pack.msg: do not edit. */
#ifndef BATTERY_WATCH_PACK_H
#define BATTERY_WATCH_PACK_H

#include <stddef.h>
#include <stdint.h>

#ifndef BATTERY_WATCH_ASSERT
#ifdef __cplusplus
#define BATTERY_WATCH_ASSERT(what) static_assert(what, #what)
#else
#define BATTERY_WATCH_ASSERT(what) _Static_assert(what, #what)
#endif
#endif

#ifndef BATTERY_WATCH_CELL_TYPE_NAME
#define BATTERY_WATCH_CELL_TYPE_NAME "battery_watch.Cell.v1"
typedef struct Cell {
    float voltage_v;
    float temperature_c;
} Cell;
BATTERY_WATCH_ASSERT(sizeof(Cell) == 8);
BATTERY_WATCH_ASSERT(offsetof(Cell, voltage_v) == 0);
BATTERY_WATCH_ASSERT(offsetof(Cell, temperature_c) == 4);
#endif

#ifndef BATTERY_WATCH_PACK_TYPE_NAME
#define BATTERY_WATCH_PACK_TYPE_NAME "battery_watch.Pack.v1"
typedef struct Pack {
    uint64_t sequence;
    uint64_t epoch_ns;
    double charge;
    Cell cells[6];
} Pack;
BATTERY_WATCH_ASSERT(sizeof(Pack) == 72);
BATTERY_WATCH_ASSERT(offsetof(Pack, sequence) == 0);
BATTERY_WATCH_ASSERT(offsetof(Pack, epoch_ns) == 8);
BATTERY_WATCH_ASSERT(offsetof(Pack, charge) == 16);
BATTERY_WATCH_ASSERT(offsetof(Pack, cells) == 24);
#endif

#define BATTERY_WATCH_PACK_SCHEMA \
    "# The flight battery, cell by cell.\n" \
    "#\n" \
    "# Layout: battery_watch.Pack.v1\n" \
    "\n" \
    "# Counts the samples of this publisher from 1.\n" \
    "uint64 sequence\n" \
    "# When the publisher began, host monotonic ns. [ns]\n" \
    "uint64 epoch_ns\n" \
    "# Charge that is left, 0 to 1.\n" \
    "float64 charge\n" \
    "# From the negative pole.\n" \
    "battery_watch_msgs/Cell[6] cells\n" \
    "================================================================================\n" \
    "MSG: battery_watch_msgs/Cell\n" \
    "# One cell.\n" \
    "#\n" \
    "# Layout: battery_watch.Cell.v1\n" \
    "\n" \
    "# Under load. [V]\n" \
    "float32 voltage_v\n" \
    "# At its surface. [deg C]\n" \
    "float32 temperature_c\n"

#endif
