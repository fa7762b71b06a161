//! `ril replay FILE --verify`, `--against` and `--keep`: no shared memory, no clock but for the time that it took.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use ipc_types::schema::CDR_HEADER;
use ipc_types::{MonotonicNs, RobotId};
use recording::play::{anchor_of, key_of};
use recording::read::{Bytes, Message, ReadError, extract, messages};
use replay::Verifier;
use runtime::exit::{ExitCode, Failure, OrFail};

use super::options::ReplayArgs;
use super::verification::{Of, Verification};
use crate::commands::json_line;
use crate::words::shell_word;

/// Topics of which verification needs every message.
const JOURNALS: [&str; 2] = ["bridge/journal", "status/journal"];

/// `ril replay FILE --verify`
///
/// # Errors
///
/// Code 2 when the file cannot be read, is no recording or has no journal; 8 when something differs or could not be verified; 78 when
/// a configuration is wrong.
pub(super) fn verify(args: &ReplayArgs) -> Result<(), Failure> {
    let bytes = open(&args.file)?;
    let mut verifier = Verifier::new();
    if let Some(config) = &args.against {
        let config = runtime::config::load::<bridge::BridgeConfig>(Some(config), config)?;
        verifier = verifier.against(config.value);
    }
    if let Some(config) = &args.against_status {
        let config = runtime::config::load::<status::config::Config>(Some(config), config)?;
        verifier = verifier.against_status(config.value);
    }
    let began = MonotonicNs::now();
    let start = drive(&bytes, &args.file, &mut verifier)?;
    let verdict = verifier.finish();
    let name = args.file.display().to_string();
    let of = Of {
        file: &name,
        against: args.against.is_some() || args.against_status.is_some(),
        start,
        took: MonotonicNs::now().since(began),
    };
    let verification = Verification::new(&verdict, &of);
    let mut out = io::stdout().lock();
    match args.json {
        true => json_line(&mut out, &verification)?,
        false => write!(out, "{verification}").map_err(Failure::output)?,
    }
    out.flush().map_err(Failure::output)?;
    match verification.trouble() {
        None => Ok(()),
        Some(text) => Err(Failure::new(verification.exit_code(), text).with_next_step(
            "`ril replay FILE --from TIME` plays the flight from shortly before that time on",
        )),
    }
}

/// `ril replay FILE --keep FOLDER`: the journals alone, and what the file says of the flight, as a file of the same name there.
///
/// # Errors
///
/// Code 2 when the file cannot be read, is no recording or has no journal, or the new one is there already; 1 when it cannot be written.
pub(super) fn keep(args: &ReplayArgs, folder: &Path) -> Result<(), Failure> {
    let bytes = open(&args.file)?;
    let mut kept = Vec::new();
    let robot = first_robot(&bytes, &args.file)?;
    extract(&bytes, &mut kept, |message| {
        journal(message, robot).is_some()
    })
    .or_fail(ExitCode::Internal)?;
    let path = place(&args.file, folder)?;
    fs::create_dir_all(folder).or_fail_with(
        ExitCode::Internal,
        format!("{} cannot be made", folder.display()),
    )?;
    let written = File::create_new(&path).and_then(|mut file| {
        file.write_all(&kept)?;
        file.sync_all()
    });
    if let Err(error) = written {
        let text = format!("{} cannot be written: {error}", path.display());
        return Err(match error.kind() {
            io::ErrorKind::AlreadyExists => {
                Failure::usage(text).with_next_step("remove it, or name another folder")
            }
            _ => Failure::internal(text),
        });
    }
    if args.common.quiet == 0 {
        let _ = writeln!(
            io::stderr(),
            "{} has the journals of the flight, {} kB; `ril replay {} --verify` verifies them",
            path.display(),
            kept.len().div_ceil(1000),
            shell_word(&path.to_string_lossy())
        );
    }
    Ok(())
}

fn place(file: &Path, folder: &Path) -> Result<PathBuf, Failure> {
    let name = file
        .file_name()
        .ok_or_else(|| Failure::usage(format!("{} is no file", file.display())))?;
    Ok(folder.join(name))
}

fn open(file: &Path) -> Result<Bytes, Failure> {
    Bytes::open(file).or_fail_with(
        ExitCode::Usage,
        format!("{} cannot be read", file.display()),
    )
}

/// Gives the journals to the verifier. Returns when the recording begins, by the clock of then.
fn drive(bytes: &[u8], file: &Path, verifier: &mut Verifier) -> Result<MonotonicNs, Failure> {
    let robot = first_robot(bytes, file)?;
    let anchor = anchor_of(bytes);
    let mut first_ns = None;
    for message in messages(bytes) {
        match message {
            Ok(message) => {
                first_ns.get_or_insert(message.log_time_ns);
                if let Some((key, sample)) = journal(&message, robot) {
                    verifier.take(key, sample);
                }
            }
            // What is missing shows in the journal's numbers.
            Err(error) => tracing::warn!(%error, "the file is damaged"),
        }
    }
    let ahead_ns = anchor.zip(first_ns).map(|(anchor, first_ns)| {
        let after_ns = first_ns.saturating_sub(anchor.unix_ns);
        let before_ns = anchor.unix_ns.saturating_sub(first_ns);
        anchor
            .monotonic
            .0
            .saturating_add(after_ns)
            .saturating_sub(before_ns)
    });
    Ok(MonotonicNs(ahead_ns.unwrap_or_default()))
}

/// The robot of the first piece of a journal.
fn first_robot(bytes: &[u8], file: &Path) -> Result<RobotId, Failure> {
    for message in messages(bytes) {
        match message {
            Ok(message) => {
                if let Some((robot, key)) = key_of(message.topic)
                    && JOURNALS.contains(&key)
                {
                    return Ok(robot);
                }
            }
            Err(ReadError::NotMcap) => {
                let text = format!("{}: {}", file.display(), ReadError::NotMcap);
                return Err(Failure::usage(text));
            }
            Err(_) => {}
        }
    }
    let text = format!(
        "{} has no journal, so nothing can be verified",
        file.display()
    );
    Err(Failure::usage(text)
        .with_next_step("record with `ril record`: bridge and status then publish their journals"))
}

/// Key and sample of a message that is a piece of this robot's journals.
fn journal<'a>(message: &Message<'a>, robot: RobotId) -> Option<(&'a str, &'a [u8])> {
    let (of, key) = key_of(message.topic)?;
    let sample = message.data.strip_prefix(&CDR_HEADER)?;
    (of == robot && JOURNALS.contains(&key)).then_some((key, sample))
}
