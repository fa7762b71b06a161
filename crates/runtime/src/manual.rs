//! Manual pages from the definition of a command line, so that both say the same.
//!
//! One page for the program and one for each of its verbs, in the order and with the names of `git` and `systemctl`:
//! `ril.1`, `ril-param.1`, `ril-param-set.1`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, Command, ValueHint};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, bold, roman};

use crate::exit::{ExitCode, Failure, OrFail};

/// The section of the manual for commands that a user runs.
const SECTION: &str = "1";

/// How the texts after the options begin that list exit codes.
const EXIT_CODES: &str = "Exit codes:";

/// Options of the verb that writes manual pages.
#[derive(Args, Clone, Debug)]
pub struct ManualArgs {
    /// Folder of the pages, such as ~/.local/share/man/man1; created if absent, pages of the same names are replaced
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub to: PathBuf,
}

/// A page of the manual.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Page {
    /// Name of its file, such as `ril-takeoff.1`.
    pub file_name: String,
    /// The page, in the language of `man`.
    pub text: String,
}

/// The pages of `program` and of all its verbs that its help shows.
pub fn pages(program: Command) -> Vec<Page> {
    let mut program = program.disable_help_subcommand(true);
    // It gives each verb its whole name.
    program.build();
    let version = program.get_version().unwrap_or_default();
    let source = format!("{} {version}", name(&program));
    let mut pages = Vec::new();
    add_pages(&program, &source, None, &mut pages);
    pages
}

/// Writes the pages of `program`.
///
/// # Errors
///
/// Code 1 when the folder or a file cannot be written.
pub fn write(program: Command, args: &ManualArgs) -> Result<(), Failure> {
    let cannot = |path: &Path| format!("{} cannot be written", path.display());
    fs::create_dir_all(&args.to).or_fail_with(ExitCode::Internal, cannot(&args.to))?;
    for page in pages(program) {
        let path = args.to.join(&page.file_name);
        fs::write(&path, &page.text).or_fail_with(ExitCode::Internal, cannot(&path))?;
    }
    Ok(())
}

fn add_pages(command: &Command, source: &str, outer: Option<&str>, pages: &mut Vec<Page>) {
    let page = render(command, source, outer).expect("a buffer can be written");
    pages.push(page);
    for verb in shown_verbs(command) {
        add_pages(verb, source, Some(name(command)), pages);
    }
}

fn shown_verbs(command: &Command) -> impl Iterator<Item = &Command> {
    command.get_subcommands().filter(|verb| !verb.is_hide_set())
}

/// The whole name, such as `ril-param-set`.
fn name(command: &Command) -> &str {
    command
        .get_display_name()
        .unwrap_or_else(|| command.get_name())
}

fn render(command: &Command, source: &str, outer: Option<&str>) -> io::Result<Page> {
    let man = Man::new(command.clone())
        .title(name(command).to_uppercase())
        .section(SECTION)
        .source(source)
        .manual("HERO RIL");
    let mut text = Vec::new();
    man.render_title(&mut text)?;
    man.render_name_section(&mut text)?;
    man.render_synopsis_section(&mut text)?;
    man.render_description_section(&mut text)?;
    if command.get_arguments().any(|one| !one.is_hide_set()) {
        man.render_options_section(&mut text)?;
    }
    if shown_verbs(command).next().is_some() {
        man.render_subcommands_section(&mut text)?;
    }
    closing_sections(command, outer).to_writer(&mut text)?;
    Ok(Page {
        file_name: man.get_filename(),
        text: String::from_utf8_lossy(&text).into_owned(),
    })
}

/// The text after the options, and the pages beside this one.
fn closing_sections(command: &Command, outer: Option<&str>) -> Roff {
    let mut roff = Roff::new();
    if let Some(text) = command.get_after_help() {
        let text = text.to_string();
        match text.trim_start().strip_prefix(EXIT_CODES) {
            Some(table) => {
                roff.control("SH", ["EXIT STATUS"]);
                exit_codes(table, &mut roff);
            }
            None => {
                roff.control("SH", ["NOTES"]);
                text.lines().for_each(|line| {
                    roff.text([roman(line.trim())]);
                });
            }
        }
    }
    if let Some(outer) = outer {
        roff.control("SH", ["SEE ALSO"]);
        roff.text([bold(outer), roman(format!("({SECTION})"))]);
    }
    roff
}

/// A table of codes and their meanings; other lines, and what continues a meaning, are text.
fn exit_codes(table: &str, roff: &mut Roff) {
    for line in table.lines().map(str::trim).filter(|line| !line.is_empty()) {
        match line.split_once(' ') {
            Some((code, meaning)) if code.parse::<u8>().is_ok() => {
                roff.control("TP", []);
                roff.text([bold(code)]);
                roff.text([roman(meaning.trim())]);
            }
            _ => {
                roff.text([roman(line)]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Arg;

    use super::*;

    fn program() -> Command {
        Command::new("tool")
            .version("1.2.3")
            .about("Does things")
            .after_help("Exit codes:\n   0  done\n  78  the configuration is wrong")
            .subcommand(
                Command::new("get")
                    .about("Read a value")
                    .arg(Arg::new("name").value_name("NAME").help("Which value"))
                    .after_help("It changes nothing."),
            )
            .subcommand(Command::new("secret").hide(true))
    }

    #[test]
    fn there_is_a_page_for_the_program_and_for_each_verb_that_the_help_shows() {
        let names: Vec<String> = pages(program())
            .into_iter()
            .map(|page| page.file_name)
            .collect();
        assert_eq!(names, ["tool.1", "tool-get.1"]);
    }

    #[test]
    fn a_page_has_the_exit_codes_as_a_table_and_other_notes_as_text() {
        let pages = pages(program());
        let (tool, get) = (&pages[0].text, &pages[1].text);
        assert!(
            tool.contains(".SH \"EXIT STATUS\"\n.TP\n\\fB0\\fR\ndone\n.TP\n\\fB78\\fR\n"),
            "{tool}"
        );
        assert!(
            tool.starts_with(".ie") || tool.contains(".TH TOOL 1"),
            "{tool}"
        );
        assert!(get.contains(".SH NOTES\nIt changes nothing."), "{get}");
        assert!(get.contains("\\fBtool\\fR(1)"), "{get}");
    }

    #[test]
    fn pages_are_written_into_a_folder_that_is_created() {
        let folder = tempfile::tempdir().unwrap();
        let args = ManualArgs {
            to: folder.path().join("man/man1"),
        };
        for _ in 0..2 {
            write(program(), &args).unwrap();
        }
        assert!(args.to.join("tool-get.1").is_file());
        let file = args.to.join("tool.1");
        let error = write(program(), &ManualArgs { to: file }).unwrap_err();
        assert_eq!(error.code(), ExitCode::Internal);
    }
}
