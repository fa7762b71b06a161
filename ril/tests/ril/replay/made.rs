//! A recording of a flight that stand-ins have published: 61 samples of raw and of SI telemetry, one each 100 ms, a
//! state each 500 ms, and a request.

use std::fs;
use std::path::{Path, PathBuf};

use ipc_types::code::LinkState;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::schema::{CDR_HEADER, text};
use ipc_types::{DynamicSubscriber, Ipc, MonotonicNs, RobotId, Schema, Topic};
use recording::{Anchor, Channel, ChannelId, FlightInfo, Recorder, Settings};
use ril_tests::{Script, StandInBridge, StandInStatus, TestDomain};

/// When it begins by the clock of then.
const START: MonotonicNs = MonotonicNs(1_000_000_000_000);

/// How old samples were when they were published.
pub const AGE_NS: u64 = 2_000_000;

/// What was recorded.
pub struct Made {
    pub file: PathBuf,
    pub hero: Vec<HeroTelemetry>,
    pub dsp: Vec<DspTelemetry>,
}

/// Records a flight into `folder`.
pub fn record(folder: &Path) -> Made {
    let domain = TestDomain::new();
    let (bridge, status) = (StandInBridge::start(&domain), StandInStatus::start(&domain));
    let ipc = domain.join("recorder");
    let script = Script::at(37.4, -5.9, 10.0)
        .every_ms(100)
        .take_off(7.0)
        .land()
        .stand(0.1);
    let mut recorder = recorder();
    let mut dsp = Tap::<DspTelemetry>::open(&ipc, &mut recorder, "/robot1/dsp/telemetry");
    let mut hero = Tap::<HeroTelemetry>::open(&ipc, &mut recorder, "/robot1/hero/telemetry");
    let mut state = Tap::<ModuleState>::open(&ipc, &mut recorder, "/robot1/bridge/state");
    let requests = requests(&mut recorder);
    let mut made = Made {
        file: folder.join("flight.mcap"),
        hero: script.hero(),
        dsp: script.dsp().to_vec(),
    };
    let mut now = START;
    for (index, (raw, si)) in made.dsp.iter().zip(&made.hero).enumerate() {
        now = START + std::time::Duration::from_millis(100) * index as u32;
        bridge.publish(raw);
        dsp.take(&mut recorder, now);
        status.publish(si);
        hero.take(&mut recorder, now);
        if index % 5 == 0 {
            let mut idle = StandInBridge::idle_state();
            idle.link.state = LinkState::Up.code();
            idle.link.commands_acknowledged = index as u32;
            bridge.publish_state(&idle);
            state.take(&mut recorder, now);
        }
        if index == 10 {
            recorder.add(now, requests, now, 0, &request());
        }
    }
    fs::write(&made.file, file(recorder, now)).unwrap();
    made.hero.truncate(made.dsp.len());
    made
}

fn recorder() -> Recorder {
    let info = FlightInfo {
        robot: RobotId::DEFAULT,
        metadata: Vec::new(),
        attachments: Vec::new(),
    };
    let anchor = Anchor {
        monotonic: START,
        unix_ns: 1_700_000_000_000_000_000,
    };
    Recorder::new(Settings::default(), info, anchor)
}

fn file(mut recorder: Recorder, now: MonotonicNs) -> Vec<u8> {
    let mut file = Vec::new();
    recorder.end(now);
    while let Some(action) = recorder.next() {
        action.apply_to(&mut file);
        recorder.done(now, Ok(()));
    }
    file
}

/// Reads a topic as bytes.
struct Tap<T> {
    topic: DynamicSubscriber,
    channel: ChannelId,
    moments: Vec<usize>,
    sequence: u32,
    payload: std::marker::PhantomData<T>,
}

impl<T: Topic> Tap<T> {
    fn open(ipc: &Ipc, recorder: &mut Recorder, topic: &str) -> Tap<T> {
        let schema = Schema::from_layout(T::LAYOUT);
        let channel = Channel {
            topic: topic.to_owned(),
            schema_name: T::LAYOUT.ros_resource_name(),
            schema_text: text(T::LAYOUT),
            metadata: Default::default(),
        };
        Tap {
            topic: DynamicSubscriber::open(ipc, T::KEY, &schema).unwrap(),
            channel: recorder.channel(channel).unwrap(),
            moments: schema.moments(),
            sequence: 0,
            payload: std::marker::PhantomData,
        }
    }

    /// Records the sample that was published, as if that had been at `now`.
    fn take(&mut self, recorder: &mut Recorder, now: MonotonicNs) {
        let mut samples = Vec::new();
        self.topic
            .drain(|bytes| samples.push(bytes.to_vec()))
            .unwrap();
        // The stand-in of the bridge publishes a first state by itself.
        let sample = samples.last_mut().expect("the sample is there");
        for offset in &self.moments {
            let moment: &mut [u8; 8] = sample[*offset..].first_chunk_mut().unwrap();
            if u64::from_le_bytes(*moment) != 0 {
                *moment = (now.0 - AGE_NS).to_le_bytes();
            }
        }
        self.sequence += 1;
        let message = [&CDR_HEADER[..], sample].concat();
        recorder.add(now, self.channel, now, self.sequence, &message);
    }
}

fn requests(recorder: &mut Recorder) -> ChannelId {
    let channel = Channel {
        topic: "/robot1/requests".to_owned(),
        schema_name: recording::play::REQUEST_EVENT.to_owned(),
        schema_text: "uint64 at_ns\n".to_owned(),
        metadata: Default::default(),
    };
    recorder.channel(channel).unwrap()
}

/// A request to take off, as `ril record` writes it.
fn request() -> Vec<u8> {
    let mut writer = ros_messages::cdr::Writer::with_capacity(100);
    for number in [START.0, 77, 0] {
        writer.u64(number);
    }
    writer.u32(812);
    for text in ["request", "movement", "takeoff", "", "", "takeoff"] {
        writer.string(text);
    }
    writer.f64s(&[f64::NAN; 3]);
    writer.finish()
}
