//! `ril topic generate`: a message definition as a struct for Rust, for C and C++, and for Python, which
//! [`ipc_types::schema::generate`] makes. Here are the files.

use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use clap::Args;
use ipc_types::Schema;
use ipc_types::schema::generate::Generated;
use operator::options::{EXIT_CODES, read_text};
use operator::render::print_as;
use runtime::exit::{ExitCode, Failure, OrFail};
use serde::Serialize;

/// `ril topic generate`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct TopicGenerateArgs {
    /// Message definition of ROS 2 with the comment `# Layout: <package>.<Struct>.v<version>`; nested structs stand in
    /// the same file
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// Folder for the three files, `<struct>.rs`, `.h` and `.py`, which are replaced if this command made them
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    pub output: PathBuf,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// What every file begins with after its comment sign. A file that begins otherwise is never replaced.
const MARK: &str = "Made by `ril topic generate`";

/// Where the mark stands in a file: within its first bytes.
const MARKED_BYTES: u64 = 128;

/// `ril topic generate`
///
/// # Errors
///
/// Code 2 for a definition that is none or cannot be read, 1 for a file that cannot be written, or that another program
/// made.
pub fn generate(args: &TopicGenerateArgs) -> Result<(), Failure> {
    let file = args.file.display();
    let mut text = read_text(&args.file)?;
    if !text.ends_with('\n') {
        text.push('\n');
    }
    let schema = Schema::parse(&text)
        .or_fail_with(ExitCode::Usage, format!("{file} is no message definition"))?;
    let name = args.file.file_name().unwrap_or_default().to_string_lossy();
    // It stands in a comment.
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "._-".contains(letter);
    let name = name.replace(|letter| !is_plain(letter), "_");
    let made = format!("{MARK} from {name}: do not edit.");
    let Generated { stem, files } = Generated::of(&schema, &text, &made).map_err(|word| {
        Failure::usage(format!(
            "{file}: `{word}` is a word of Rust, C, C++ or Python and can't be a name: choose another"
        ))
    })?;
    let path = |ending| args.output.join(format!("{stem}.{ending}"));
    let files = files.map(|(ending, text)| (path(ending), text));
    for (path, _) in &files {
        check(path)?;
    }
    let mut names = Vec::new();
    for (path, text) in &files {
        let name = path.display().to_string();
        fs::write(path, text)
            .or_fail_with(ExitCode::Internal, format!("{name} cannot be written"))?;
        names.push(name);
    }
    let text = format!("{}\n", names.join("\n"));
    let object = GeneratedObject {
        schema: "ril.Generated.v1",
        type_name: schema.type_name(),
        bytes: schema.size(),
        layout_hash: format!("{:016x}", schema.layout_hash()),
        files: names,
    };
    print_as(args.json, &object, text)
}

/// What was made, as one JSON object.
#[derive(Serialize)]
struct GeneratedObject<'a> {
    schema: &'static str,
    #[serde(rename = "type")]
    type_name: &'a str,
    bytes: usize,
    layout_hash: String,
    files: Vec<String>,
}

/// Whether the file may be replaced: it is not there, or this command made it.
fn check(path: &Path) -> Result<(), Failure> {
    let mut begin = Vec::new();
    let read = File::open(path).and_then(|file| file.take(MARKED_BYTES).read_to_end(&mut begin));
    let is_ours = || String::from_utf8_lossy(&begin).contains(MARK);
    match read {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Ok(_) if is_ours() => Ok(()),
        _ => Err(Failure::internal(format!(
            "{} exists already, and `ril topic generate` did not make it: use --output with another folder",
            path.display()
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_this_command_made_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pack.rs");
        assert!(check(&path).is_ok(), "it is not there");
        for (content, is_ours) in [
            (
                format!("// {MARK} from Pack.msg: do not edit.\n").into_bytes(),
                true,
            ),
            (b"fn main() {}\n".to_vec(), false),
            (b"\xff\xfe no text".to_vec(), false),
            (Vec::new(), false),
        ] {
            fs::write(&path, content).unwrap();
            assert_eq!(check(&path).is_ok(), is_ours);
        }
        assert!(check(folder.path()).is_err(), "a folder");
    }
}
