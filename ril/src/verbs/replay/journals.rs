//! The journals in a recording, and whole kept flights.

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, SharedStruct};
use ipc_types::schema::CDR_HEADER;
use ipc_types::{MonotonicNs, RobotId, Topic};
use recording::play::key_of;
use recording::read::{ReadError, RecordFile, RecordedMessage, messages};
use replay::kept::{MAGIC, NotKept, is_kept};
use runtime::exit::{ExitCode, Failure, OrFail};

/// Topics of which verification needs every message.
const JOURNALS: [&str; 2] = ["bridge/journal", "status/journal"];

/// Telemetry comes within some hundred messages of a recording, unless the robot was started later: then its journals
/// begin later, too.
const MOST_LOOKED_AT: usize = 100_000;

/// Opens a recording.
pub(super) fn open(file: &Path) -> Result<RecordFile, Failure> {
    RecordFile::open(file).or_fail_with(
        ExitCode::Usage,
        format!("{} cannot be read", file.display()),
    )
}

/// The robot of the first piece of a journal.
pub(super) fn first_robot(record: &RecordFile, file: &Path) -> Result<RobotId, Failure> {
    let mut unsupported = None;
    for message in messages(record) {
        match message {
            Ok(message) => {
                if let Some((robot, key)) = key_of(message.topic())
                    && JOURNALS.contains(&key)
                {
                    return Ok(robot);
                }
            }
            Err(ReadError::NotMcap) => {
                let text = format!("{}: {}", file.display(), ReadError::NotMcap);
                return Err(Failure::usage(text));
            }
            Err(error) if error.is_unsupported() => unsupported = Some(error),
            Err(_) => {}
        }
    }
    if let Some(error) = unsupported {
        return Err(Failure::usage(error).context(file.display().to_string()));
    }
    let text = format!(
        "{} has no journal, so nothing can be verified",
        file.display()
    );
    Err(Failure::usage(text)
        .with_next_step("record with `ril record`: bridge and status then publish their journals"))
}

/// Key and sample of a message that is a piece of this robot's journals.
pub(super) fn piece(message: &RecordedMessage, robot: RobotId) -> Option<(&str, &[u8])> {
    let (of, key) = key_of(message.topic())?;
    let sample = message.data().strip_prefix(&CDR_HEADER)?;
    (of == robot && JOURNALS.contains(&key)).then_some((key, sample))
}

/// When the first sample of bridge and of status in the record was received, by the clock of then; 0 without one among
/// the first [`MOST_LOOKED_AT`] messages.
pub(super) fn first_samples(record: &RecordFile, robot: RobotId) -> [MonotonicNs; 2] {
    let mut first = [None; 2];
    for message in messages(record).take(MOST_LOOKED_AT).flatten() {
        let Some(sample) = message.data().strip_prefix(&CDR_HEADER) else {
            continue;
        };
        match key_of(message.topic()) {
            Some((of, DspTelemetry::KEY)) if of == robot => {
                let sample = DspTelemetry::from_bytes(sample);
                first[0] = first[0].or(sample.map(|sample| sample.received_ns));
            }
            Some((of, HeroTelemetry::KEY)) if of == robot => {
                let sample = HeroTelemetry::from_bytes(sample);
                first[1] = first[1].or(sample.map(|sample| sample.received_ns));
            }
            _ => {}
        }
        if first.iter().all(Option::is_some) {
            break;
        }
    }
    first.map(|received_ns| MonotonicNs(received_ns.unwrap_or_default()))
}

/// The bytes of a file that is a kept flight by its first bytes; `None` for everything else.
pub(super) fn kept_flight(file: &Path) -> Result<Option<Vec<u8>>, Failure> {
    let mut first = [0; MAGIC.len()];
    let is_file = fs::metadata(file).is_ok_and(|metadata| metadata.is_file());
    let read =
        is_file && File::open(file).is_ok_and(|mut file| file.read_exact(&mut first).is_ok());
    if !read || !is_kept(&first) {
        return Ok(None);
    }
    let bytes = fs::read(file).or_fail_with(
        ExitCode::Usage,
        format!("{} cannot be read", file.display()),
    )?;
    Ok(Some(bytes))
}

/// Why the kept flight in `file` cannot be read.
pub(super) fn refuse_kept(file: &Path, error: &NotKept) -> Failure {
    let next_step = match error {
        NotKept::Damaged => "take the file again from where it was made",
        NotKept::Foreign | NotKept::Empty => "name a file that `ril replay FILE --keep` has made",
        NotKept::Version(_) | NotKept::Layout(_) => {
            "verify it with the version that made it, or keep the flight again from its recording"
        }
    };
    Failure::usage(format!("{}: {error}", file.display())).with_next_step(next_step)
}
