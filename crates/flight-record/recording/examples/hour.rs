//! Records an hour of a robot's telemetry as fast as the disk takes it, for the commands of `ril log` to be measured
//! with.
//!
//! `cargo run --release -p recording --example hour -- FOLDER [SAMPLES_PER_SECOND] [SECONDS]`

use std::error::Error;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::time::{Duration, Instant};

use ipc_types::payload::{DspTelemetry, HeroTelemetry, SharedStruct};
use ipc_types::{MonotonicNs, RobotId, Schema, Topic};
use recording::{Anchor, Channel, ChannelId, FileAction, FlightInfo, Recorder, Settings};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("name a folder for the files")?;
    let samples_per_s = arguments.next().map_or(Ok(50), |text| text.parse())?;
    let seconds: u64 = arguments.next().map_or(Ok(3600), |text| text.parse())?;
    let path = Path::new(&folder).join("hour.mcap");

    let began = Instant::now();
    record(&path, samples_per_s, seconds)?;
    let spent = began.elapsed();
    let bytes = std::fs::metadata(&path)?.len();
    println!("{bytes} bytes, {:.1} s to record", spent.as_secs_f64());
    Ok(())
}

/// What both clocks show at a moment of this example.
fn anchor(now: MonotonicNs) -> Anchor {
    Anchor {
        monotonic: now,
        unix_ns: 1_700_000_000_000_000_000 + now.0,
    }
}

fn channel<T: Topic>(recorder: &mut Recorder) -> Option<ChannelId> {
    let schema = Schema::of::<T>();
    recorder.channel(Channel {
        topic: format!("/robot1/{}", T::KEY.replace('_', "/")),
        schema_name: schema.ros_resource_name(),
        schema_text: ipc_types::schema::text(T::LAYOUT),
        metadata: [].into(),
    })
}

fn record(path: &Path, samples_per_s: u64, seconds: u64) -> Result<(), Box<dyn Error>> {
    let mut now = MonotonicNs(1_000_000_000);
    let info = FlightInfo {
        robot: RobotId::DEFAULT,
        metadata: Vec::new(),
        attachments: Vec::new(),
    };
    let mut recorder = Recorder::new(Settings::default(), info, anchor(now));
    let dsp = channel::<DspTelemetry>(&mut recorder).ok_or("too many topics")?;
    let hero = channel::<HeroTelemetry>(&mut recorder).ok_or("too many topics")?;
    let mut file = None;
    for sequence in 1..=samples_per_s * seconds {
        now = now + Duration::from_nanos(1_000_000_000 / samples_per_s);
        let sample = DspTelemetry {
            sequence,
            received_ns: now.0,
            ..DspTelemetry::ZERO
        };
        let message = ros_messages::message(sample.bytes());
        recorder.add(now, dsp, now, sequence as u32, &message);
        let sample = HeroTelemetry {
            sequence,
            received_ns: now.0,
            ..HeroTelemetry::ZERO
        };
        let message = ros_messages::message(sample.bytes());
        recorder.add(now, hero, now, sequence as u32, &message);
        if recorder.deadline().is_some_and(|at| at <= now) {
            recorder.wake(now, anchor(now));
            perform(&mut recorder, now, path, &mut file)?;
        }
    }
    recorder.end(now);
    perform(&mut recorder, now, path, &mut file)
}

/// Does what the recorder wants done. A failure ends this example; a program would report it by `done`.
fn perform(
    recorder: &mut Recorder,
    now: MonotonicNs,
    path: &Path,
    file: &mut Option<File>,
) -> Result<(), Box<dyn Error>> {
    while let Some(action) = recorder.next() {
        match (action, &*file) {
            (FileAction::Open { .. }, _) => *file = Some(File::create_new(path)?),
            (FileAction::Write { parts }, Some(file)) => {
                for part in parts {
                    file.write_all_at(&part.bytes, part.at)?;
                }
            }
            (FileAction::Truncate { len }, Some(file)) => file.set_len(len)?,
            // An hour's syncs within seconds would measure the disk.
            (FileAction::Sync, _) => {}
            (FileAction::Close { .. }, _) => *file = None,
            (_, None) => return Err("the first action opens a file".into()),
        }
        recorder.done(now, Ok(()));
    }
    Ok(())
}
