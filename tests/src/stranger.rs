//! [`STRANGER`]: the struct of a module that this workspace does not know.

/// A schema with what the robot's own do not have: arrays of structs, of signed numbers, of small numbers.
pub const STRANGER: &str = "\
# Layout: battery_watch.Battery.v3

uint64 sequence
uint64 epoch_ns
int64 offset_ns
float64[3] gains
battery_watch_msgs/Cell[2] cells
analog_msgs/Channel channel

================================================================================
MSG: battery_watch_msgs/Cell
# Layout: battery_watch.Cell.v1

float32 voltage_v
int16[2] temperatures
uint16 age_s
int8 sign
uint8[5] name

================================================================================
MSG: analog_msgs/Channel
# Layout: analog.Channel.v1

int32 offset_adc
uint32 scale_adc
";
