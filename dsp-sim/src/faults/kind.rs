//! The kinds of faults by the names that a script gives them.

use serde::Deserialize;

/// The values of `kind` in a `[[fault]]` table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Bits turn over.
    FlipBits,
    /// Bytes are lost.
    DropBytes,
    /// Bytes come twice.
    DuplicateBytes,
    /// Random bytes are put in.
    InsertBytes,
    /// Bytes come late.
    DelayBytes,
    /// Bytes come in pieces.
    SplitBytes,
    /// Runs of bytes are replaced by random ones.
    Burst,
    /// Nothing comes out of the serial link for a time.
    Stall,
    /// Everything is lost.
    Outage,
    /// Messages are lost.
    Drop,
    /// Messages come twice.
    Repeat,
    /// Messages come late.
    Late,
    /// Messages change places.
    Reorder,
    /// The DSP queues an error.
    RaiseError,
    /// The DSP boots again.
    Reboot,
    /// The DSP stops its status transmission.
    StopStatus,
    /// The DSP hangs for a time.
    Hang,
    /// The DSP's clock jumps.
    ClockJump,
    /// The status mask changes on the DSP.
    ChangeMask,
    /// The pilot flies for a time.
    PilotTakesOver,
    /// The battery is low.
    BatteryLow,
    /// The fuel is low.
    FuelLow,
    /// The altitude of the GPS drifts.
    GpsAltitudeDrift,
    /// The GPS has no fix for a time.
    LoseFix,
    /// The port goes and comes back.
    HangUp,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 25] = [
        Kind::FlipBits,
        Kind::DropBytes,
        Kind::DuplicateBytes,
        Kind::InsertBytes,
        Kind::DelayBytes,
        Kind::SplitBytes,
        Kind::Burst,
        Kind::Stall,
        Kind::Outage,
        Kind::Drop,
        Kind::Repeat,
        Kind::Late,
        Kind::Reorder,
        Kind::RaiseError,
        Kind::Reboot,
        Kind::StopStatus,
        Kind::Hang,
        Kind::ClockJump,
        Kind::ChangeMask,
        Kind::PilotTakesOver,
        Kind::BatteryLow,
        Kind::FuelLow,
        Kind::GpsAltitudeDrift,
        Kind::LoseFix,
        Kind::HangUp,
    ];

    /// The name in a file.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::FlipBits => "flip_bits",
            Kind::DropBytes => "drop_bytes",
            Kind::DuplicateBytes => "duplicate_bytes",
            Kind::InsertBytes => "insert_bytes",
            Kind::DelayBytes => "delay_bytes",
            Kind::SplitBytes => "split_bytes",
            Kind::Burst => "burst",
            Kind::Stall => "stall",
            Kind::Outage => "outage",
            Kind::Drop => "drop",
            Kind::Repeat => "repeat",
            Kind::Late => "late",
            Kind::Reorder => "reorder",
            Kind::RaiseError => "raise_error",
            Kind::Reboot => "reboot",
            Kind::StopStatus => "stop_status",
            Kind::Hang => "hang",
            Kind::ClockJump => "clock_jump",
            Kind::ChangeMask => "change_mask",
            Kind::PilotTakesOver => "pilot_takes_over",
            Kind::BatteryLow => "battery_low",
            Kind::FuelLow => "fuel_low",
            Kind::GpsAltitudeDrift => "gps_altitude_drift",
            Kind::LoseFix => "lose_fix",
            Kind::HangUp => "hang_up",
        }
    }
}
