// Made by `ril topic generate` from Pack.msg: do not edit.

ipc_types::shared_struct! {
    /// One cell.
    pub struct Cell("battery_watch.Cell.v1") = 8 {
        /// Under load. [V]
        pub voltage_v: f32,
        /// At its surface. [deg C]
        pub temperature_c: f32,
    }
}

ipc_types::shared_struct! {
    /// The flight battery, cell by cell.
    pub struct Pack("battery_watch.Pack.v1") = 72 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publisher began, host monotonic ns. [ns]
        pub epoch_ns: u64,
        /// Charge that is left, 0 to 1.
        pub charge: f64,
        /// From the negative pole.
        pub cells: [Cell; 6],
    }
}
