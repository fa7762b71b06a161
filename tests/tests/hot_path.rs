//! From the bytes of the serial line to the sample of robot telemetry nothing is allocated, once the link is up.
//!
//! The cores alone, against the simulator in virtual time; `ipc-types/tests/allocation.rs` has what shared memory costs.

use std::time::Duration;

use bridge::{Bridge, BridgeConfig, Input, Outputs, RequestKey};
use dsp_sim::simulator::{Setup, Simulator};
use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RequestReport};
use status::calibration::Calibration;
use status::core::{Output, Status};
use status::log::Logs;

use crate::bytes::heap::Heap;

/// Status behind the bridge, as in two processes.
struct Behind {
    status: Status,
    now: MonotonicNs,
    samples: u64,
    latest: HeroTelemetry,
}

impl Outputs for Behind {
    fn notice(&mut self, _: &bridge::outputs::Notice) {}

    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let mut sample = DspTelemetry::default();
        fill(&mut sample);
        self.samples += 1;
        (sample.sequence, sample.epoch_ns) = (self.samples, 1);
        let translated = self.status.apply(self.now, status::Input::Sample(sample));
        if let Some(Output::Telemetry(hero)) = translated {
            self.latest = hero;
        }
        self.status
            .apply(self.now, status::Input::Published(Ok(())));
    }

    fn state(&mut self, _state: &ModuleState) {}

    fn report(&mut self, _to: RequestKey, _report: &RequestReport) {}
}

#[test]
fn nothing_is_allocated_between_the_line_and_the_consumer() {
    const WARM_UP: Duration = Duration::from_secs(3);
    const END: Duration = Duration::from_secs(13);
    let mut dsp = Simulator::new(Setup::default());
    let mut bridge = Bridge::new(&BridgeConfig::default());
    let mut behind = Behind {
        status: Status::new(Calibration::default(), Logs::default(), MonotonicNs(1)),
        now: MonotonicNs::default(),
        samples: 0,
        latest: HeroTelemetry::default(),
    };
    bridge.apply(MonotonicNs(1), Input::PortOpened, &mut behind);
    let (mut now, mut line) = (Duration::ZERO, Vec::with_capacity(4096));
    let (mut allocations, mut counted_from) = (0, 0);
    while now < END {
        now += Duration::from_millis(1);
        behind.now = MonotonicNs(1) + now;
        dsp.advance(now);
        line.clear();
        dsp.transmit(|bytes| {
            line.extend_from_slice(bytes);
            bytes.len()
        });
        let before = Heap::now();
        bridge.apply(behind.now, Input::Received(&line), &mut behind);
        bridge.apply(behind.now, Input::Advance, &mut behind);
        let count = bridge.transmit(behind.now).len();
        if now > WARM_UP {
            allocations += before.since().allocations;
        } else {
            counted_from = behind.samples;
        }
        let taken = dsp.receive(now, bridge.transmit(behind.now));
        assert_eq!(taken, count);
        bridge.apply(behind.now, Input::Transmitted(taken), &mut behind);
    }
    let samples = behind.samples - counted_from;
    assert!(samples >= 400, "{samples} samples");
    assert_eq!(behind.latest.source_sequence, behind.samples);
    assert_eq!(allocations, 0, "over {samples} samples");
}
