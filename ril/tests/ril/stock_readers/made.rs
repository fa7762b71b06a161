//! A recording of messages that this test makes up, in virtual time: the robot's own structs with any bits, a
//! stranger's struct, messages with texts and sequences.

use std::time::Duration;

use fastrand::Rng;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, SharedStruct};
use ipc_types::{MonotonicNs, RobotId, Schema, schema};
use recording::{
    Anchor, Attachment, Channel, ChannelId, Event, EventKind, FileAction, FlightInfo, Recorder,
    Settings,
};
use ril_tests::readers::expected::{Expected, Line, bytes, fields_of, text};
use ril_tests::stranger::STRANGER;
use ros_messages::cdr::Writer;
use ros_messages::{Level, Log, definition, message};

/// Unix time at the monotonic time 0.
const UNIX_NS: u64 = 1_700_000_000_123_456_789;

/// Samples of each topic.
const ROUNDS: u64 = 60;

/// Between two rounds: the recording has about a dozen flushes.
const PERIOD: Duration = Duration::from_millis(50);

const CHUNK_TEXT: &str = "# A piece of something.\n\nuint64 at_ns\nuint8[] data\nstring[] names\n";

/// What was done to the disk: an action, when, and how many messages had been written before and after.
pub struct Step {
    pub at: MonotonicNs,
    pub action: FileAction,
}

/// A recording, and what is in it.
pub struct Made {
    pub steps: Vec<Step>,
    pub expected: Expected,
    /// When each message of a topic was given to the recorder.
    pub given: Vec<(String, MonotonicNs)>,
}

impl Made {
    /// The file when all was done.
    pub fn finished(&self) -> Vec<u8> {
        let mut file = Vec::new();
        for step in &self.steps {
            step.action.apply_to(&mut file);
        }
        file
    }
}

/// A sample of any bytes.
fn any_bytes(random: &mut Rng, size: usize) -> Vec<u8> {
    let mut sample = vec![0; size];
    random.fill(&mut sample);
    sample
}

struct Maker {
    recorder: Recorder,
    now: MonotonicNs,
    made: Made,
}

impl Maker {
    fn channel(
        &mut self,
        topic: &str,
        schema_name: &str,
        schema_text: &str,
    ) -> (String, ChannelId) {
        let topic = format!("/robot7/{topic}");
        let channel = Channel {
            topic: topic.clone(),
            schema_name: schema_name.to_owned(),
            schema_text: schema_text.to_owned(),
            metadata: [].into(),
        };
        (topic, self.recorder.channel(channel).unwrap())
    }

    fn add(
        &mut self,
        (topic, id): &(String, ChannelId),
        sequence: u64,
        cdr: &[u8],
        fields: Vec<String>,
    ) {
        self.recorder
            .add(self.now, *id, self.now, sequence as u32, cdr);
        self.made.given.push((topic.clone(), self.now));
        self.expect(topic, Some(sequence as u32), fields);
        self.settle();
    }

    fn expect(&mut self, topic: &str, sequence: Option<u32>, fields: Vec<String>) {
        let time = UNIX_NS + self.now.0;
        let line = Line {
            log_time: Some(time),
            publish_time: Some(time),
            sequence,
            fields,
        };
        self.made
            .expected
            .0
            .entry(topic.to_owned())
            .or_default()
            .push(line);
    }

    fn event(&mut self, text_in_words: &str) {
        let event = Event {
            at: self.now,
            kind: EventKind::Gap,
            topic: "/robot7/dsp/telemetry".to_owned(),
            count: 3,
            first: MonotonicNs(self.now.0 - 5),
            last: MonotonicNs(self.now.0 - 4),
            text: text_in_words.to_owned(),
        };
        self.recorder.event(self.now, &event);
        let fields = vec![
            format!("at_ns={}", event.at.0),
            format!("first_ns={}", event.first.0),
            format!("last_ns={}", event.last.0),
            "count=3".to_owned(),
            format!("kind={}", text("gap")),
            format!("topic={}", text(&event.topic)),
            format!("text={}", text(text_in_words)),
        ];
        self.expect("/robot7/recording/events", None, fields);
        self.settle();
    }

    /// Does what there is to do with the file.
    fn settle(&mut self) {
        while let Some(action) = self.recorder.next() {
            let at = self.now;
            self.made.steps.push(Step { at, action });
            self.recorder.done(self.now, Ok(()));
        }
    }

    fn pass(&mut self, duration: Duration) {
        let end = self.now + duration;
        while let Some(at) = self.recorder.deadline().filter(|at| *at <= end) {
            self.now = self.now.max(at);
            self.recorder.wake(self.now, anchor(self.now));
            self.settle();
        }
        self.now = end;
    }
}

fn anchor(now: MonotonicNs) -> Anchor {
    Anchor {
        monotonic: now,
        unix_ns: UNIX_NS + now.0,
    }
}

/// The recording.
pub fn made() -> Made {
    let now = MonotonicNs(77_000_000_001);
    let info = FlightInfo {
        robot: RobotId::new(7).unwrap(),
        metadata: vec![(
            "ril.flight".to_owned(),
            [("host".to_owned(), "field".to_owned())].into(),
        )],
        attachments: vec![Attachment {
            name: "bridge.toml".to_owned(),
            media_type: "application/toml".to_owned(),
            data: b"robot_id = 7\n".to_vec(),
        }],
    };
    let mut maker = Maker {
        recorder: Recorder::new(Settings::default(), info, anchor(now)),
        now,
        made: Made {
            steps: Vec::new(),
            expected: Expected::default(),
            given: Vec::new(),
        },
    };
    #[rustfmt::skip]
    let structs = [
        ("dsp/telemetry", Schema::of::<DspTelemetry>(), schema::text(DspTelemetry::LAYOUT)),
        ("hero/telemetry", Schema::of::<HeroTelemetry>(), schema::text(HeroTelemetry::LAYOUT)),
        ("bridge/state", Schema::of::<ModuleState>(), schema::text(ModuleState::LAYOUT)),
        ("battery_watch/battery", Schema::parse(STRANGER).unwrap(), STRANGER.to_owned()),
    ];
    let structs = structs.map(|(topic, schema, text)| {
        let channel = maker.channel(topic, &schema.ros_resource_name(), &text);
        (channel, schema)
    });
    let log = maker.channel("log", Log::TYPE_NAME, &definition(Log::TYPE_NAME).unwrap());
    let pieces = maker.channel("pieces", "stranger_msgs/msg/Piece", CHUNK_TEXT);
    maker.channel("silent", "stranger_msgs/msg/Piece", CHUNK_TEXT);

    let mut random = Rng::with_seed(1);
    maker.settle();
    for round in 1..=ROUNDS {
        for (channel, schema) in &structs {
            let sample = any_bytes(&mut random, schema.size());
            maker.add(
                channel,
                round,
                &message(&sample),
                fields_of(schema, &sample),
            );
        }
        add_log(&mut maker, &log, round);
        add_piece(
            &mut maker,
            &pieces,
            round,
            &any_bytes(&mut random, (round % 7) as usize),
        );
        if round % 20 == 0 {
            maker.event("three samples did not come");
        }
        maker.pass(PERIOD);
    }
    maker.recorder.end(maker.now);
    maker.settle();
    assert!(maker.recorder.is_ended());
    maker.made
}

fn add_log(maker: &mut Maker, channel: &(String, ChannelId), round: u64) {
    let words = ["", "link up", "Größe 3 µs – „gut“"][(round % 3) as usize];
    let line = Log {
        unix_ns: (UNIX_NS + maker.now.0) as i64,
        level: Level::Warn,
        process: "bridge",
        text: words,
        module: "",
    };
    let fields = vec![
        format!("stamp.sec={}", line.unix_ns / 1_000_000_000),
        format!("stamp.nanosec={}", line.unix_ns % 1_000_000_000),
        "level=30".to_owned(),
        format!("name={}", text("bridge")),
        format!("msg={}", text(words)),
        "file=".to_owned(),
        "function=".to_owned(),
        "line=0".to_owned(),
    ];
    maker.add(channel, round, &line.write(), fields);
}

/// Sequences of bytes and of texts, also empty ones.
fn add_piece(maker: &mut Maker, channel: &(String, ChannelId), round: u64, data: &[u8]) {
    let names: &[&str] = [&[][..], &["a"], &["", "bcd"]][(round % 3) as usize];
    let mut writer = Writer::with_capacity(64);
    writer.u64(maker.now.0);
    writer.u32(data.len() as u32);
    data.iter().for_each(|byte| writer.u8(*byte));
    writer.u32(names.len() as u32);
    names.iter().for_each(|name| writer.string(name));
    let mut fields = vec![format!("at_ns={}", maker.now.0)];
    fields.extend(bytes("data", data));
    if names.is_empty() {
        fields.push("names=[]".to_owned());
    }
    let elements = names.iter().enumerate();
    fields.extend(elements.map(|(index, name)| format!("names[{index}]={}", text(name))));
    maker.add(channel, round, &writer.finish(), fields);
}
