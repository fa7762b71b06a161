//! [`SampleReader`]: a row of a log becomes the sample that it was made of, as far as the log has its columns.

use ipc_types::TelemetryGroup as Group;
use ipc_types::payload::DspTelemetry;

use crate::verbs::log::recording::Row;

/// Puts a number into a sample.
type Put = fn(&mut DspTelemetry, f64);

/// A column, the group that its value makes valid, and where the value goes.
type Column = (&'static str, Option<Group>, Put);

/// The columns that a report needs. A cell that is empty leaves its group invalid.
const COLUMNS: [Column; 15] = [
    ("dsp_time_ms", Some(Group::Time), |dsp, value| {
        dsp.dsp_time_ms = value as u32
    }),
    ("latitude_deg", Some(Group::Geographic), |dsp, value| {
        dsp.geographic.latitude_deg = value
    }),
    ("longitude_deg", Some(Group::Geographic), |dsp, value| {
        dsp.geographic.longitude_deg = value
    }),
    ("altitude_m", Some(Group::Geographic), |dsp, value| {
        dsp.geographic.altitude_m = value
    }),
    (
        "gps_horizontal_speed_mps",
        Some(Group::GpsVelocity),
        |dsp, value| {
            dsp.gps_velocity.horizontal_speed_mps = value as f32;
        },
    ),
    (
        "gps_vertical_speed_mps",
        Some(Group::GpsVelocity),
        |dsp, value| {
            dsp.gps_velocity.vertical_speed_mps = value as f32;
        },
    ),
    ("gps_heading_deg", Some(Group::GpsVelocity), |dsp, value| {
        dsp.gps_velocity.heading_deg = value as f32;
    }),
    ("gps_quality", Some(Group::GpsQuality), |dsp, value| {
        dsp.gps_quality = value as u8
    }),
    ("battery_mv", Some(Group::Supply), |dsp, value| {
        dsp.supply.battery_mv = value as u32
    }),
    ("fuel_percent", Some(Group::Supply), |dsp, value| {
        dsp.supply.fuel_percent = value as u32
    }),
    ("auto_switch", Some(Group::Supply), |dsp, value| {
        dsp.supply.auto_switch = value as u32
    }),
    ("rotor_rpm", Some(Group::RotorSpeed), |dsp, value| {
        dsp.rotor_rpm = value as u32
    }),
    (
        "reference_altitude_m",
        Some(Group::References),
        |dsp, value| {
            dsp.references.altitude_m = value as f32;
        },
    ),
    ("dsp_errors", None, |dsp, value| {
        dsp.dsp_errors = value as u32
    }),
    ("last_dsp_error_code", None, |dsp, value| {
        dsp.last_dsp_error_code = value as u32
    }),
];

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct SampleReader {
    /// Where in a row a value stands, and where it goes.
    places: Vec<(usize, &'static Column)>,
}

impl SampleReader {
    /// A reader of logs with `columns`.
    pub fn new(columns: &[String]) -> SampleReader {
        let place = |column: &'static Column| {
            let place = columns.iter().position(|name| name == column.0)?;
            Some((place, column))
        };
        let mut places: Vec<_> = COLUMNS.iter().filter_map(place).collect();
        places.sort_by_key(|(place, _)| *place);
        SampleReader { places }
    }

    /// The sample of `row`.
    pub fn sample(&self, row: &Row<'_>) -> DspTelemetry {
        let mut sample = DspTelemetry {
            sequence: row.sequence,
            received_ns: row.received_ns,
            flying: u8::from(row.flying),
            ..DspTelemetry::default()
        };
        let mut wanted = self.places.iter().peekable();
        for (index, cell) in row.cells().enumerate() {
            let Some((place, (_, group, put))) = wanted.peek() else {
                break;
            };
            if *place != index {
                continue;
            }
            if let Some(value) = cell.parse::<f64>().ok().filter(|value| value.is_finite()) {
                put(&mut sample, value);
                sample.valid_groups |= group.map_or(0, |group| group.bit());
            }
            wanted.next();
        }
        sample
    }
}
