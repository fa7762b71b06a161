//! A recorded flight with faults: the page of the replay shows what `ril watch` showed, however the playhead moves.

use std::fs;
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

use ipc_types::code::{Functionality, LinkState};
use ipc_types::module::State;
use ipc_types::payload::{HeroTelemetry, ModuleState, SharedStruct};
use ipc_types::schema::{CDR_HEADER, text};
use ipc_types::{Module, MonotonicNs, RobotId, StatusModule, Topic};
use operator::robot::fixture::{at, hero, on_path, state, translating, without_fix};
use operator::robot::freshness::{MODULE_OVERDUE_AFTER, OVERDUE_AFTER};
use operator::robot::model::{Process, WatchedRobot};
use recording::topic_of;
use recording::{Anchor, Channel, ChannelId, Event, EventKind, FlightInfo, Recorder, Settings};

use super::recording::Recording;
use crate::page::Weight;

const ZERO_UNIX_NS: u64 = 1_700_000_000_000_000_000;

/// A sample of one of the topics that a recorder writes.
#[allow(clippy::large_enum_variant)]
enum Sample {
    Bridge(ModuleState),
    Hero(HeroTelemetry),
    Status(State),
    /// A process that does not live, when a recorder finds that.
    End(Process),
}

/// When status is killed and starts again, ms, in the flight of [`flight`].
const WITHOUT_STATUS: Range<u64> = 50_000..56_000;

/// When the bridge is killed and starts again, ms, in the flight of [`flight`].
const WITHOUT_BRIDGE: Range<u64> = 51_000..57_000;

/// Whether a process lives at a moment of the flight.
fn lives(process: Process, now: MonotonicNs) -> bool {
    let ms = now.since(at(0)).as_millis() as u64;
    match process {
        Process::Bridge => !WITHOUT_BRIDGE.contains(&ms),
        Process::Status => !WITHOUT_STATUS.contains(&ms),
        Process::Relay => true,
    }
}

/// A flight of so many ms with a sample of each each 250 ms, without those that fail, and with the faults of a bad day.
fn flight(ms: u64) -> Vec<(MonotonicNs, Sample)> {
    let mut samples = Vec::new();
    for ms in (0..=ms).step_by(250) {
        let mut bridge = match ms {
            0..8000 => state(Functionality::TakingOff, ms),
            _ => on_path(0, ms),
        };
        if (20_000..24_000).contains(&ms) {
            bridge.link.state = LinkState::Silent.code();
        }
        if ms >= 26_000 {
            bridge.dsp_errors.total = 1;
            bridge.dsp_errors.last_code = 7;
        }
        if !WITHOUT_STATUS.contains(&ms) {
            samples.push((at(ms), Sample::Status(translating(ms))));
        }
        if !(40_000..46_000).contains(&ms) && !WITHOUT_BRIDGE.contains(&ms) {
            samples.push((at(ms + 1), Sample::Bridge(bridge)));
        }
        if !(30_000..34_000).contains(&ms) {
            let telemetry = match ms / 1000 {
                15 => without_fix(ms),
                _ => hero(ms as f64 / 1000.0, 25.0, ms),
            };
            samples.push((at(ms + 2), Sample::Hero(telemetry)));
        }
        // A recorder looks for a process when its topic is overdue.
        for (process, without, last_ms, overdue) in [
            (
                Process::Status,
                WITHOUT_STATUS,
                49_750,
                MODULE_OVERDUE_AFTER,
            ),
            (Process::Bridge, WITHOUT_BRIDGE, 50_751, OVERDUE_AFTER),
        ] {
            let found = at(last_ms) + overdue;
            if without.contains(&ms) && (at(ms)..at(ms + 250)).contains(&found) {
                samples.push((found, Sample::End(process)));
            }
        }
    }
    samples.sort_by_key(|(time, _)| *time);
    samples
}

/// What `ril watch` writes down of a robot, when: it takes each sample as it comes, and wakes when it has to.
fn watched(samples: &[(MonotonicNs, Sample)]) -> Vec<(MonotonicNs, String)> {
    let mut robot = WatchedRobot::new(RobotId::DEFAULT);
    let mut now = at(0);
    let judge = |robot: &mut WatchedRobot, now| {
        for process in robot.looks_due(now).collect::<Vec<_>>() {
            robot.provider(process, lives(process, now), now);
        }
        robot.judge(now);
    };
    let mut lines = Vec::new();
    for (time, sample) in samples {
        judge(&mut robot, now);
        while let Some(wake) = robot.next(now).filter(|wake| wake < time) {
            now = wake;
            judge(&mut robot, now);
        }
        now = *time;
        match sample {
            Sample::Bridge(state) => robot.state(state, now),
            Sample::Hero(hero) => robot.hero(hero, now),
            Sample::Status(state) => robot.status(state, now),
            Sample::End(_) => {}
        }
        judge(&mut robot, now);
    }
    let kept = robot.journal.newest(usize::MAX);
    lines.extend(kept.map(|line| (line.at, line.text.clone())));
    lines
}

fn channel<T: SharedStruct>(recorder: &mut Recorder, key: &str) -> ChannelId {
    let channel = Channel {
        topic: topic_of(RobotId::DEFAULT, key),
        schema_name: T::LAYOUT.ros_resource_name(),
        schema_text: text(T::LAYOUT),
        metadata: Default::default(),
    };
    recorder.channel(channel).unwrap()
}

/// The bytes of a file with these samples; one that is not finished ends as after a kill.
fn file(samples: &[(MonotonicNs, Sample)], is_finished: bool) -> Vec<u8> {
    let anchor = Anchor {
        monotonic: at(0),
        unix_ns: ZERO_UNIX_NS + at(0).0,
    };
    let info = FlightInfo {
        robot: RobotId::DEFAULT,
        metadata: Vec::new(),
        attachments: Vec::new(),
    };
    let mut recorder = Recorder::new(Settings::default(), info, anchor);
    let bridge = channel::<ModuleState>(&mut recorder, ModuleState::KEY);
    let telemetry = channel::<HeroTelemetry>(&mut recorder, HeroTelemetry::KEY);
    let status = channel::<State>(&mut recorder, StatusModule::STATE_KEY);
    let mut file = Vec::new();
    let mut now = at(0);
    for (time, sample) in samples {
        now = *time;
        let (id, bytes) = match sample {
            Sample::End(process) => {
                recorder.event(now, &end(*process, now));
                write(&mut recorder, now, &mut file);
                continue;
            }
            Sample::Bridge(sample) => (bridge, sample.bytes()),
            Sample::Hero(sample) => (telemetry, sample.bytes()),
            Sample::Status(sample) => (status, sample.bytes()),
        };
        recorder.add(now, id, now, 0, &[&CDR_HEADER[..], bytes].concat());
        write(&mut recorder, now, &mut file);
    }
    if is_finished {
        recorder.end(now);
        write(&mut recorder, now, &mut file);
    }
    file
}

fn end(process: Process, now: MonotonicNs) -> Event {
    Event {
        at: now,
        kind: EventKind::End,
        topic: topic_of(RobotId::DEFAULT, process.key()),
        count: 1,
        first: now,
        last: now,
        text: String::new(),
    }
}

fn write(recorder: &mut Recorder, now: MonotonicNs, file: &mut Vec<u8>) {
    while let Some(action) = recorder.next() {
        action.apply_to(file);
        recorder.done(now, Ok(()));
    }
}

/// A file in a folder of its own.
fn written(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.mcap");
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn open(bytes: &[u8]) -> (Recording, crate::page::ReplayInfo) {
    let (_folder, path) = written(bytes);
    Recording::open(&path, |_| {}).unwrap()
}

#[test]
fn a_replay_has_the_alarms_and_events_of_the_flight_at_their_times() {
    let samples = flight(66_000);
    let expected = watched(&samples);
    let texts: Vec<&str> = expected.iter().map(|(_, text)| text.as_str()).collect();
    for fault in [
        "link to the DSP silent",
        "over: link to the DSP silent",
        "telemetry is 1 s old",
        "the bridge says nothing: is it stopped, or is the machine overloaded?",
        "no GPS fix in flight",
        "`ril run status` has ended: telemetry is the bridge's own, and no logs are written",
        "the bridge is gone: start `ril bridge --robot 1`",
        "over: the bridge is gone: start `ril bridge --robot 1`",
    ] {
        assert!(texts.contains(&fault), "{fault}: {texts:#?}");
    }
    let (_, info) = open(&file(&samples, true));
    let replayed: Vec<&str> = info.events.iter().map(|event| &*event.text).collect();
    assert_eq!(replayed, texts);
    for (event, (time, text)) in info.events.iter().zip(&expected) {
        let apart_s = event.at_s - time.since(at(0)).as_secs_f64();
        assert!((0.0..=0.051).contains(&apart_s), "{text}: {apart_s}");
    }
    assert_eq!(info.duration_s, 66.002);
    assert_eq!(
        info.start_unix_ms,
        Some((ZERO_UNIX_NS + at(0).0) / 1_000_000)
    );
    let phases: Vec<&str> = info.phases.iter().map(|phase| &*phase.text).collect();
    // While the bridge is silent or gone, what the helicopter does is not known.
    let path = "flying the path";
    assert_eq!(phases, ["taking off", path, path, path]);
    assert!(
        info.events
            .iter()
            .any(|event| event.severity == Weight::Alarm)
    );
}

#[test]
fn a_moment_without_a_fix_has_no_position_but_the_last_one_with_its_age() {
    let (mut recording, _) = open(&file(&flight(60_000), true));
    for (ms, age_ms) in [(14_900, None), (15_700, Some(950)), (16_100, None)] {
        recording.jump_to(Duration::from_millis(ms), |_| {});
        let played = recording.played();
        let said = crate::messages::now(&played.robot, 1, at(ms), at(ms));
        assert_eq!(said.lost_position_age_ms, age_ms, "{ms} ms");
        let (place, altitude_m) = (said.position, said.altitude_m);
        let is_lost = age_ms.is_some();
        assert_eq!(
            (place.is_none(), altitude_m.is_none()),
            (is_lost, is_lost),
            "{said:?}"
        );
        let place = place.or(said.lost_position).expect("a place");
        assert!((place[0] - 37.4112).abs() < 1e-6, "{said:?}");
    }
}

#[test]
fn a_moment_looks_the_same_whatever_way_leads_there() {
    let bytes = file(&flight(60_000), true);
    let (mut straight, _) = open(&bytes);
    let (mut astray, _) = open(&bytes);
    let mut random = fastrand::Rng::with_seed(23);
    for position_ms in (0..60_000).step_by(1700) {
        for _ in 0..3 {
            let position = Duration::from_millis(random.u64(0..70_000));
            match random.bool() {
                true => astray.jump_to(position, |_| {}),
                false => astray.go_to(position, |_| {}),
            }
        }
        let position = Duration::from_millis(position_ms);
        straight.go_to(position, |_| {});
        astray.go_to(position, |_| {});
        let [expected, found] = [&straight, &astray].map(|one| format!("{:?}", one.played()));
        assert_eq!(found, expected, "{position_ms} ms");
    }
}

#[test]
fn what_is_kept_of_a_long_recording_is_bounded_and_leads_everywhere() {
    let mut samples = flight(60_000);
    samples
        .extend((61..1500).map(|s| (at(s * 1000), Sample::Hero(hero(s as f64, 25.0, s * 1000)))));
    // Years without a message: a clock that was damaged.
    let late = at(1_000_000_000_000);
    samples.push((late, Sample::Hero(hero(0.0, 25.0, 1_000_000_000_000))));
    let bytes = file(&samples, true);
    let (mut recording, info) = open(&bytes);
    assert!(recording.kept() <= 64, "{}", recording.kept());
    assert!(info.duration_s > 9e8);
    for s in [1400, 3, 700, 699, 1499] {
        recording.go_to(Duration::from_secs(s), |_| {});
        let received = recording.played().robot.pilot.received;
        // Each sample has the time of its second.
        assert_eq!(
            received,
            Some(at(s * 1000 - if s < 61 { 250 } else { 0 })),
            "{s}"
        );
    }
}

#[test]
fn what_is_whole_of_a_damaged_or_unfinished_file_is_shown_and_the_rest_is_named() {
    let samples = flight(60_000);
    let whole = file(&samples, true);
    let (_, expected) = open(&whole);

    let unfinished = file(&samples, false);
    let (mut recording, info) = open(&unfinished);
    // The last chunk was not written yet.
    assert!(
        (55.0..=60.1).contains(&info.duration_s),
        "{}",
        info.duration_s
    );
    recording.go_to(Duration::from_secs(21), |_| {});
    assert_eq!(recording.played().robot.alarms.lasting().count(), 1);

    let mut damaged = whole.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 0xff;
    let (mut recording, info) = open(&damaged);
    assert_eq!(info.duration_s, expected.duration_s);
    let named = |text: &str| info.events.iter().any(|event| event.text.starts_with(text));
    assert!(
        named("recording: the file is damaged"),
        "{:#?}",
        info.events
    );
    // Also after many jumps over the damage.
    for _ in 0..20 {
        recording.jump_to(Duration::from_secs(59), |_| {});
        recording.go_to(Duration::ZERO, |_| {});
    }
    recording.go_to(Duration::from_secs(61), |_| {});
    assert_eq!(recording.played().robot.pilot.received, Some(at(60_000)));

    for (bytes, expected) in [
        (&b"no recording"[..], "not an MCAP file"),
        (&file(&[], true), "no sample of a robot's topic"),
    ] {
        let (_folder, path) = written(bytes);
        let error = Recording::open(&path, |_| {}).err().unwrap();
        let chain = format!("{:?}", error.chain());
        assert!(chain.contains(expected), "{chain}");
    }
}
