//! `ril replay FILE --keep`: the inputs of a flight as a file that every later version drives its cores with.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use ipc_types::MonotonicNs;
use recording::read::messages;
use replay::{Keeper, Kept, Verifier};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::journals::{first_robot, kept_flight, open, piece, refuse_kept};
use super::options::ReplayArgs;
use super::verify::{Of, Verification};
use crate::recorded::new_file;
use crate::render::words::shell_word;

/// `ril replay FILE --keep FOLDER`: a kept flight of the same name there.
///
/// # Errors
///
/// Code 2 when the file cannot be read, is no recording or has no journal, or the new one is there already or cannot be written; 8 when
/// the cores of this version say something else than what was recorded.
pub(super) fn keep(args: &ReplayArgs, folder: &Path) -> Result<(), Failure> {
    if kept_flight(&args.file)?.is_some() {
        let text = format!("{} is a kept flight already", args.file.display());
        return Err(Failure::usage(text).with_next_step("copy the file"));
    }
    let kept = read(args)?
        .finish()
        .map_err(|error| refuse_kept(&args.file, &error))?;
    verify(&args.file, &kept.file)?;
    let path = place(&args.file, folder)?;
    fs::create_dir_all(folder).or_fail_with(
        ExitCode::Internal,
        format!("{} cannot be made", folder.display()),
    )?;
    let next_step = "remove it, or name another folder with --keep";
    new_file(&path, next_step, |to| Ok(to.write_all(&kept.file)?))?;
    if args.common.settings.quiet == 0 {
        say(&path, &kept);
    }
    Ok(())
}

fn read(args: &ReplayArgs) -> Result<Keeper, Failure> {
    let record = open(&args.file)?;
    let robot = first_robot(&record, &args.file)?;
    let mut keeper = Keeper::default();
    for message in messages(&record) {
        match message {
            Ok(message) => {
                if let Some((key, sample)) = piece(&message, robot) {
                    keeper.take(key, sample);
                }
            }
            Err(error) => tracing::warn!(%error, "the file is damaged"),
        }
    }
    Ok(keeper)
}

/// A test that fails from the first day is none.
fn verify(file: &Path, kept: &[u8]) -> Result<(), Failure> {
    let began = MonotonicNs::now();
    let mut verifier = Verifier::new();
    verifier
        .take_kept(kept)
        .map_err(|error| refuse_kept(file, &error))?;
    let name = file.display().to_string();
    let of = Of {
        file: &name,
        against: false,
        start: MonotonicNs(0),
        recorded: [0; 2],
        took: MonotonicNs::now().since(began),
    };
    let verification = Verification::new(&verifier.finish(), &of);
    match verification.trouble() {
        None => Ok(()),
        Some(text) => Err(Failure::new(verification.exit_code(), text)
            .context(format!("{name} is not kept"))
            .with_next_step("`ril replay FILE --verify` lists what differs")),
    }
}

fn place(file: &Path, folder: &Path) -> Result<PathBuf, Failure> {
    let stem = file
        .file_stem()
        .ok_or_else(|| Failure::usage(format!("{} is no file", file.display())))?;
    let mut name = stem.to_owned();
    name.push(".kept");
    Ok(folder.join(name))
}

fn say(path: &Path, kept: &Kept) {
    let word = shell_word(&path.to_string_lossy());
    let kilobytes = kept.file.len().div_ceil(1000);
    let bound = match kept.is_from_the_start {
        true => "from the start of the processes",
        false => {
            "from a snapshot, which this version alone reads, because the recording began later than the processes"
        }
    };
    // Standard error may be closed; the file is there.
    let _ = writeln!(
        io::stderr(),
        "{} has the inputs of the flight {bound}, {kilobytes} kB; `ril replay {word} --verify` verifies it",
        path.display(),
    );
}
