//! The short names of topics on a command line.

use ipc_types::ServiceId;
use recording::name_of;

/// The short names of the robot's own topics, and what they are.
pub const SHORT_NAMES: [(&str, ServiceId, &str); 3] = [
    (
        "dsp",
        ServiceId::DspTelemetry,
        "Telemetry as the DSP sends it",
    ),
    ("hero", ServiceId::HeroTelemetry, "Telemetry in SI units"),
    ("state", ServiceId::ModuleState, "State of the module"),
];

/// The key that the short name of a topic stands for, or its name in recordings; any other text is a key by itself.
pub fn key_of(name: &str) -> &str {
    let mut names = SHORT_NAMES.iter();
    let short = names.find(|(short, service, _)| *short == name || name_of(service.key()) == name);
    short.map_or(name, |(_, service, _)| service.key())
}
