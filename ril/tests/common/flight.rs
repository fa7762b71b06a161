//! A helicopter in the air.

use ril_tests::Process;
use ril_tests::process::Signal;

use super::{Rig, end, json};

/// A simulator and a bridge, started and in the air; the place as `LATITUDE,LONGITUDE` and the altitude, m.
pub struct Flight {
    pub sim: Process,
    pub bridge: Process,
    pub place: (f64, f64, f64),
}

impl Flight {
    pub fn begin(rig: &Rig) -> Flight {
        let sim = rig.sim(1, "--speed 10");
        let bridge = rig.bridge(1);
        rig.watch(1).until_ready();
        rig.run("start", 0);
        rig.run("takeoff --altitude 10", 0);
        let sample = json(
            &rig.run("echo dsp --count 1 --json --field geographic", 0)
                .stdout[0],
        );
        let value = |name: &str| sample["geographic"][name].as_f64().unwrap();
        Flight {
            place: (
                value("latitude_deg"),
                value("longitude_deg"),
                value("altitude_m"),
            ),
            sim,
            bridge,
        }
    }

    /// A path of 5 km, which takes minutes.
    pub fn far_away(&self, rig: &Rig) -> Process {
        let (latitude, longitude, altitude) = self.place;
        let remote = latitude + 0.045;
        let mut path = rig.start(&format!("goto {remote},{longitude},{altitude}"));
        path.wait_for_text("goto: progress");
        path
    }

    pub fn end(self) {
        for process in [self.bridge, self.sim] {
            end(process, Signal::INT);
        }
    }
}
