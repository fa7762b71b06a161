//! `ril new module`: a module with its test, to begin with. The files are templates beside this one.

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use ipc_types::module::is_own_name;
use operator::options::EXIT_CODES;
use operator::render::print_as;
use runtime::exit::{ExitCode, Failure, OrFail};
use serde::Serialize;

/// `ril new`
#[derive(Args, Clone, Debug)]
pub struct NewArgs {
    /// What to begin.
    #[command(subcommand)]
    pub command: NewCommand,
}

/// `ril new …`
#[derive(Clone, Debug, Subcommand)]
pub enum NewCommand {
    /// Write a module of your own with its test, which builds and passes
    Module(NewModuleArgs),
}

/// `ril new module`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct NewModuleArgs {
    /// Name of the module, one word in lower snake case, which becomes that of its new folder
    #[arg(value_name = "NAME", value_parser = module_name)]
    pub name: String,

    /// The language
    #[arg(long, value_enum, default_value = "rust")]
    pub lang: Language,

    /// Where the repository of the RIL lies, for Cargo.toml
    #[arg(long, value_name = "FOLDER", default_value = "hero-ril")]
    pub ril: PathBuf,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// What was written, as one JSON object.
#[derive(Serialize)]
struct NewModuleObject {
    schema: &'static str,
    files: Vec<String>,
    /// The command that runs its test.
    test: String,
}

/// A language of modules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Language {
    /// Rust, with the kit
    Rust,
    /// Python, with the package hero_ril
    Python,
    /// C++, with CMake
    Cpp,
}

/// A name that a module can have, and a Rust library and a file, too.
fn module_name(text: &str) -> Result<String, String> {
    let is_word = text.starts_with(|first: char| first.is_ascii_lowercase())
        && text.len() <= 32
        && { text.bytes() }
            .all(|byte| byte == b'_' || byte.is_ascii_lowercase() || byte.is_ascii_digit());
    match is_word {
        _ if is_own_name(text) => Err(format!("`{text}` is the RIL's own module")),
        true => Ok(text.to_owned()),
        false => Err("it is no word in lower snake case of up to 32 letters".to_owned()),
    }
}

/// The files of a language: their names and templates.
fn templates(language: Language) -> &'static [(&'static str, &'static str)] {
    match language {
        Language::Rust => &[
            ("Cargo.toml", include_str!("templates/Cargo.toml.in")),
            ("src/lib.rs", include_str!("templates/lib.rs.in")),
            ("src/main.rs", include_str!("templates/main.rs.in")),
            ("tests/module.rs", include_str!("templates/module.rs.in")),
        ],
        Language::Python => &[
            ("@NAME@.py", include_str!("templates/module.py.in")),
            (
                "test_@NAME@.py",
                include_str!("templates/test_module.py.in"),
            ),
        ],
        Language::Cpp => &[
            (
                "CMakeLists.txt",
                include_str!("templates/CMakeLists.txt.in"),
            ),
            ("@NAME@.hpp", include_str!("templates/module.hpp.in")),
            ("@NAME@.cpp", include_str!("templates/module.cpp.in")),
            (
                "test_@NAME@.cpp",
                include_str!("templates/test_module.cpp.in"),
            ),
        ],
    }
}

/// `battery_watch` as `BatteryWatch`.
fn type_name(name: &str) -> String {
    let words = name.split('_').filter(|word| !word.is_empty());
    words
        .map(|word| word[..1].to_ascii_uppercase() + &word[1..])
        .collect()
}

/// `ril new`
///
/// # Errors
///
/// Code 2 when the folder is there already, or that of the RIL is not, 1 when it cannot be written.
pub fn new(NewCommand::Module(args): &NewCommand) -> Result<(), Failure> {
    let name = &args.name;
    let folder = Path::new(name);
    if folder.exists() {
        return Err(Failure::usage(format!("{name} exists already")));
    }
    if args.lang == Language::Rust && !args.ril.join("ipc-types/Cargo.toml").is_file() {
        let folder = args.ril.display();
        return Err(Failure::usage(format!(
            "{folder} is not the repository of the RIL: name its folder with --ril"
        )));
    }
    // Cargo.toml lies in the new folder, one deeper than the working directory.
    let ril = match args.ril.is_absolute() {
        true => args.ril.clone(),
        false => Path::new("..").join(&args.ril),
    };
    let filled = |text: &str| {
        let pairs = [
            ("@NAME@", name.clone()),
            ("@CRATE@", name.replace('_', "-")),
            ("@TYPE@", type_name(name)),
            ("@RIL@", ril.display().to_string()),
        ];
        pairs
            .iter()
            .fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
    };
    let mut files = Vec::new();
    for (file, template) in templates(args.lang) {
        let path = folder.join(filled(file));
        let written = path
            .parent()
            .map_or(Ok(()), fs::create_dir_all)
            .and_then(|()| fs::write(&path, filled(template)));
        written.or_fail_with(
            ExitCode::Internal,
            format!("{} cannot be written", path.display()),
        )?;
        files.push(path.display().to_string());
    }
    let test = match args.lang {
        Language::Rust => format!("cd {name} && cargo test"),
        Language::Python => format!("cd {name} && pytest"),
        Language::Cpp => format!(
            "cmake -S {name} -B {name}/build && cmake --build {name}/build && ctest --test-dir {name}/build"
        ),
    };
    let text = format!("{name} is written. Its test: {test}\n");
    let object = NewModuleObject {
        schema: "ril.NewModule.v1",
        files,
        test,
    };
    print_as(args.json, &object, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_modules_are_words_in_lower_snake_case() {
        for name in ["bridge", "relay", "Belt", "2belts", "belt-drive", ""] {
            assert!(module_name(name).is_err(), "{name}");
        }
        assert_eq!(module_name("belt_drive_2").as_deref(), Ok("belt_drive_2"));
        assert_eq!(type_name("belt_drive_2"), "BeltDrive2");
        assert_eq!(type_name("belt__"), "Belt");
    }
}
