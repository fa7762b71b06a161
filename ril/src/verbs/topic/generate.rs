//! `ril topic generate`: a message definition as a struct for Rust, for C and C++, and for Python.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::iter;
use std::path::{Path, PathBuf};

use clap::Args;
use ipc_types::Schema;
use ipc_types::payload::Layout;
use ipc_types::schema::generate;
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

/// The words of Rust, C, C++ and Python that a field or a struct of a definition could have as its name, and none of
/// them can.
const WORDS: &str = "\
    False None Self True abstract alignas alignof and as asm assert async auto await become bool box break case catch char class \
    compl concept const consteval constexpr constinit continue crate decltype def default del delete do double dyn elif else enum \
    except explicit export extern false final finally float fn for friend from gen global goto if impl import in inline int is \
    lambda let long loop macro match mod move mut mutable namespace new noexcept nonlocal not nullptr operator or override pass \
    priv private protected pub public raise ref register reinterpret_cast requires restrict return self short signed sizeof \
    static struct super switch template this throw trait true try type typedef typename typeof union unsafe unsigned unsized use \
    using virtual void volatile where while with xor yield";

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
    let layout = generate::layout_of(&schema);
    if let Some(word) = reserved(layout) {
        return Err(Failure::usage(format!(
            "{file}: `{word}` is a word of Rust, C, C++ or Python and can't be a name: choose another"
        )));
    }
    let name = args.file.file_name().unwrap_or_default().to_string_lossy();
    // It stands in a comment.
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "._-".contains(letter);
    let name = name.replace(|letter| !is_plain(letter), "_");
    let stem = generate::upper_snake(layout.name).to_lowercase();
    let made = format!("{MARK} from {name}: do not edit.");
    let files = [
        ("rs", rust(layout, &made)),
        ("h", c_header(layout, &text, &made)),
        ("py", python(layout, &text, &made)),
    ];
    let files: Vec<(PathBuf, String)> = files
        .into_iter()
        .map(|(ending, text)| (args.output.join(format!("{stem}.{ending}")), text))
        .collect();
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

/// The first name in a definition that is a word of a language.
fn reserved(layout: &'static Layout) -> Option<&'static str> {
    let names = |layout: &'static Layout| {
        let fields = layout.fields.iter().map(|field| field.name);
        iter::once(layout.name).chain(fields)
    };
    let mut names = layout.with_nested().into_iter().flat_map(names);
    names.find(|name| WORDS.split_whitespace().any(|word| word == *name))
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

fn rust(layout: &'static Layout, made: &str) -> String {
    format!("// {made}\n{}", generate::rust_module(&[layout]))
}

/// The header has the definition too, for `hero_ril_topic` and `hero_ril_service`.
fn c_header(layout: &'static Layout, definition: &str, made: &str) -> String {
    let (package, name) = (layout.package(), generate::upper_snake(layout.name));
    let guard = format!("{package}_{name}").to_uppercase();
    let mut schema = format!("#define {guard}_SCHEMA");
    for line in definition.lines() {
        let line = line.replace('\\', "\\\\").replace('"', "\\\"");
        // Writing to a string cannot fail.
        let _ = write!(schema, " \\\n    \"{line}\\n\"");
    }
    let header = generate::c_header(&format!("{guard}_H"), &[layout]);
    let end = header.rfind("\n#endif\n").unwrap_or(header.len());
    format!("/* {made} */\n{}\n{schema}\n\n#endif\n", &header[..end])
}

/// The definition goes along, so that a topic has the comments and units.
fn python(layout: &'static Layout, definition: &str, made: &str) -> String {
    let definition = definition.replace('\\', "\\\\").replace("\"\"\"", "'''");
    let module = generate::python_module(&[layout]);
    let name = layout.name;
    format!("# {made}\n{module}\n\nsetattr({name}, \"SCHEMA\", \"\"\"\\\n{definition}\"\"\")\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_of_a_language_is_no_name() {
        let of = |field: &str, nested: &str| {
            let text = format!(
                "# Layout: pack.Pack.v1\n\nCell[2] cells\nfloat64 {field}\n{}\nMSG: pack_msgs/Cell\nfloat64 {nested}\n",
                "=".repeat(80)
            );
            reserved(generate::layout_of(&Schema::parse(&text).unwrap()))
        };
        assert_eq!(of("charge", "voltage_v"), None);
        for word in ["type", "from", "class", "struct"] {
            assert_eq!(of(word, "voltage_v"), Some(word));
            assert_eq!(of("charge", word), Some(word));
        }
    }

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
