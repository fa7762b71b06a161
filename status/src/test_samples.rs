//! Telemetry and log files for the tests of this crate.

use std::cell::RefCell;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use ipc_types::payload::{
    DspAcceleration, DspAngularRate, DspAttitude, DspGeographic, DspGpsVelocity, DspPanTilt,
    DspReferences, DspServoPulses, DspSupply, DspTelemetry, DspXy,
};

use crate::log::store::{Sink, Store};

/// A sample with all groups valid and a different number in every field.
pub(crate) fn full_sample() -> DspTelemetry {
    DspTelemetry {
        sequence: 41,
        epoch_ns: 1_000,
        received_ns: 5_000_000_000,
        dsp_time_ms: 12_345,
        valid_groups: 0xFFFF,
        flying: 1,
        gps_quality: 4,
        dsp_boots: 2,
        dsp_errors: 3,
        last_dsp_error_imi: 230,
        rotor_rpm: 1500,
        geographic: DspGeographic {
            latitude_deg: 30.0,
            longitude_deg: -45.0,
            altitude_m: 123.456,
        },
        xy: DspXy {
            x_m: -3.5,
            y_m: 4.25,
        },
        gps_velocity: DspGpsVelocity {
            horizontal_speed_mps: 10.0,
            vertical_speed_mps: -1.5,
            heading_deg: 300.0,
        },
        attitude: DspAttitude {
            pitch_deg: -30.0,
            roll_deg: 45.0,
            yaw_deg: 180.0,
        },
        acceleration: DspAcceleration {
            x_mps2: 0.5,
            y_mps2: -0.25,
            z_mps2: -9.75,
        },
        angular_rate: DspAngularRate {
            x_radps: 0.125,
            y_radps: -0.5,
            z_radps: 1.5,
        },
        pilot_pwm: DspServoPulses {
            collective_us: 1000,
            roll_us: 1250,
            pitch_us: 1500,
            tail_us: 1750,
            throttle_us: 2000,
        },
        actuation: DspServoPulses {
            collective_us: 2000,
            roll_us: 1750,
            pitch_us: 1500,
            tail_us: 1250,
            throttle_us: 1000,
        },
        sonar_adc: 1200,
        barometer_adc: 1000,
        supply: DspSupply {
            battery_mv: 11_100,
            fuel_percent: 75,
            auto_switch: 1,
        },
        pan_tilt: DspPanTilt {
            pan_adc: 3072,
            tilt_adc: 0,
        },
        references: DspReferences {
            x_speed_mps: 1.5,
            y_speed_mps: -2.5,
            altitude_m: 50.25,
            pitch_deg: -5.0,
            roll_deg: 10.0,
            yaw_deg: -90.0,
            reserved: 0,
        },
    }
}

/// The `sequence`-th sample of the bridge that began at `epoch_ns`.
pub(crate) fn sample(epoch_ns: u64, sequence: u64) -> DspTelemetry {
    DspTelemetry {
        sequence,
        epoch_ns,
        ..full_sample()
    }
}

/// A file in memory that can be told to fail.
#[derive(Clone, Default)]
pub(crate) struct Memory(Rc<RefCell<MemoryFile>>);

#[derive(Default)]
struct MemoryFile {
    bytes: Vec<u8>,
    failing: bool,
}

impl Memory {
    pub(crate) fn sink(&self) -> Sink {
        Box::new(self.clone())
    }

    pub(crate) fn text(&self) -> String {
        String::from_utf8(self.0.borrow().bytes.clone()).unwrap()
    }

    /// From now on the disk is full.
    pub(crate) fn fail(&self) {
        self.0.borrow_mut().failing = true;
    }

    pub(crate) fn recover(&self) {
        self.0.borrow_mut().failing = false;
    }
}

impl Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut file = self.0.borrow_mut();
        if file.failing {
            return Err(io::ErrorKind::StorageFull.into());
        }
        file.bytes.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A file system in memory; the directory `forbidden` cannot be written.
#[derive(Clone, Default)]
pub(crate) struct MemoryStore {
    pub(crate) files: Rc<RefCell<Vec<(PathBuf, Memory)>>>,
}

impl MemoryStore {
    /// The file created as the `index`-th.
    pub(crate) fn file(&self, index: usize) -> Memory {
        self.files.borrow()[index].1.clone()
    }
}

impl Store for MemoryStore {
    fn create(&mut self, directory: &Path, stem: &str) -> io::Result<(PathBuf, Sink)> {
        if directory == Path::new("forbidden") {
            return Err(io::ErrorKind::PermissionDenied.into());
        }
        let path = directory.join(format!("{stem}.tsv"));
        let memory = Memory::default();
        self.files.borrow_mut().push((path.clone(), memory.clone()));
        Ok((path, memory.sink()))
    }
}
