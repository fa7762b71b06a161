//! [`QuotingBash`]: completion in bash, whose words reach the program as they stand on the command line, quotes and
//! backslashes included. What is offered is quoted in the same way, so that it stays one word.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;

use clap::Command;
use clap_complete::engine::complete;
use clap_complete::env::EnvCompleter;

use operator::render::words::ansi_c;
use runtime::plain::plain_name;

/// Set by the scripts of bash and zsh: which word is to be completed, from 0. In fish it is the last one.
pub(super) const INDEX_VARIABLE: &str = "_CLAP_COMPLETE_INDEX";

/// The part of the word before the cursor that bash will replace: without a quotation mark that stands before it.
const TYPED_VARIABLE: &str = "_RIL_COMPLETE_TYPED";

/// Each candidate is a line. `compopt` fails where no key was pressed, and an old bash cannot keep the order.
const SCRIPT: &str = r#"_clap_complete_NAME() {
    mapfile -t COMPREPLY < <(
        INDEX="$COMP_CWORD" TYPED="$2" VAR="bash" "BIN" -- "${COMP_WORDS[@]}"
    )
    if [[ "${COMPREPLY-}" =~ [=/]$ ]]; then
        compopt -o nospace 2> /dev/null
    fi
}
complete -o bashdefault -o nosort -F _clap_complete_NAME BIN 2> /dev/null \
    || complete -o bashdefault -F _clap_complete_NAME BIN
"#;

/// Bash, in which names with blanks, `$` and the like stay one word.
pub(super) struct QuotingBash;

impl EnvCompleter for QuotingBash {
    fn name(&self) -> &'static str {
        "bash"
    }

    fn is(&self, name: &str) -> bool {
        name == self.name()
    }

    fn write_registration(
        &self,
        variable: &str,
        name: &str,
        program: &str,
        _completer: &str,
        to: &mut dyn Write,
    ) -> io::Result<()> {
        let script = SCRIPT
            .replace("INDEX", INDEX_VARIABLE)
            .replace("TYPED", TYPED_VARIABLE)
            .replace("NAME", name)
            .replace("BIN", program)
            .replace("VAR", variable);
        to.write_all(script.as_bytes())
    }

    fn write_complete(
        &self,
        command: &mut Command,
        args: Vec<OsString>,
        current_dir: Option<&Path>,
        to: &mut dyn Write,
    ) -> io::Result<()> {
        let index = std::env::var(INDEX_VARIABLE).ok();
        let index = index.and_then(|index| index.parse().ok());
        let typed = std::env::var(TYPED_VARIABLE).ok();
        let line = Line::of(args, index.unwrap_or_default(), typed);
        for candidate in complete(command, line.words, line.index, current_dir)? {
            let value = candidate.get_value().to_string_lossy();
            let value = value.strip_prefix(&line.option).unwrap_or(&value);
            // A file of such a name would be taken for an option.
            let is_file =
                value.starts_with('-') && line.option.is_empty() && Path::new(value).exists();
            let value = &[if is_file { "./" } else { "" }, value].concat();
            if let Some(quoted) = line.quotes.quote(value) {
                writeln!(to, "{quoted}")?;
            }
        }
        Ok(())
    }
}

/// How the word that is to be completed is quoted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quotes {
    None,
    Single,
    Double,
}

impl Quotes {
    /// `word` behind these quotes; the shell adds the closing one. `None` if it cannot stand there.
    fn quote(self, word: &str) -> Option<String> {
        let has_control = plain_name(word) != word;
        Some(match self {
            Quotes::None if has_control => ansi_c(word),
            _ if has_control => return None,
            Quotes::Single => word.replace('\'', r"'\''"),
            Quotes::Double => escaped(word, |letter| r#""$\`"#.contains(letter)),
            Quotes::None => escaped(word, |letter| {
                !letter.is_alphanumeric() && letter.is_ascii() && !"_-./,=+@%^".contains(letter)
            }),
        })
    }
}

/// `word` with a backslash before each of its letters that is `special`.
fn escaped(word: &str, special: impl Fn(char) -> bool) -> String {
    let mut quoted = String::new();
    for letter in word.chars() {
        quoted.extend(special(letter).then_some('\\'));
        quoted.push(letter);
    }
    quoted
}

/// A command line without its quotes.
#[derive(Debug)]
struct Line {
    words: Vec<OsString>,
    index: usize,
    quotes: Quotes,
    /// `--option=` before the value that is to be completed: bash takes it for words of their own.
    option: String,
}

impl Line {
    /// Of the words as they stand there; `typed` of the one at `index` stands before the cursor.
    fn of(words: Vec<OsString>, index: usize, typed: Option<String>) -> Line {
        let texts: Vec<String> = words
            .iter()
            .map(|word| word.to_string_lossy().into_owned())
            .collect();
        let present = texts.get(index).cloned().unwrap_or_default();
        let quotes = match present.chars().next() {
            Some('\'') => Quotes::Single,
            Some('"') => Quotes::Double,
            _ => Quotes::None,
        };
        let is_assigning = present == "=";
        let mut value = match (typed, quotes) {
            (None, _) => unquoted(&present),
            (Some(_), _) if is_assigning => String::new(),
            (Some(typed), Quotes::None) => unquoted(&typed),
            (Some(typed), Quotes::Single) => typed,
            (Some(typed), Quotes::Double) => unquoted(&format!("\"{typed}")),
        };
        let mut before: Vec<String> = texts
            .iter()
            .take(index)
            .map(|word| unquoted(word))
            .collect();
        let equals = is_assigning || before.pop_if(|word| word == "=").is_some();
        let mut option = String::new();
        if equals && let Some(name) = before.pop_if(|name| name.starts_with("--")) {
            option = name + "=";
            value.insert_str(0, &option);
        }
        let after = texts.into_iter().skip(index + 1);
        let index = before.len();
        let words = before.into_iter().chain([value]).chain(after);
        Line {
            words: words.map(OsString::from).collect(),
            index,
            quotes,
            option,
        }
    }
}

/// `word` without quotes and backslashes, as the shell would give it to a program; nothing is expanded.
fn unquoted(word: &str) -> String {
    let (mut text, mut quotes) = (String::new(), Quotes::None);
    let mut letters = word.chars().peekable();
    while let Some(letter) = letters.next() {
        match (letter, quotes) {
            ('\'', Quotes::None) => quotes = Quotes::Single,
            ('"', Quotes::None) => quotes = Quotes::Double,
            ('\'', Quotes::Single) | ('"', Quotes::Double) => quotes = Quotes::None,
            ('\\', Quotes::None) => text.extend(letters.next()),
            ('\\', Quotes::Double) => {
                let special = letters.next_if(|letter| r#""$\`"#.contains(*letter));
                text.push(special.unwrap_or('\\'));
            }
            (letter, _) => text.push(letter),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(words: &[&str], typed: &str) -> (Vec<OsString>, usize, Quotes, String) {
        let args = words.iter().map(OsString::from).collect();
        let line = Line::of(args, words.len() - 1, Some(typed.to_owned()));
        (line.words, line.index, line.quotes, line.option)
    }

    #[test]
    fn a_word_is_read_without_its_quotes_and_offered_with_them() {
        for (typed, present, word, quotes, offered) in [
            (r"my\ f", r"my\ f", "my f", Quotes::None, r"my\ f\$\'\\\*"),
            ("my f", "\"my f", "my f", Quotes::Double, r"my f\$'\\*"),
            ("my f", "'my f", "my f", Quotes::Single, r"my f$'\''\*"),
            (r"a\$b", "\"a\\$b", "a$b", Quotes::Double, r"my f\$'\\*"),
        ] {
            let (words, index, found, _) = line(&["ril", present], typed);
            assert_eq!((index, found), (1, quotes), "{present}");
            assert_eq!(words, ["ril", word]);
            assert_eq!(quotes.quote(r"my f$'\*").as_deref(), Some(offered));
        }
    }

    #[test]
    fn what_is_quoted_is_one_word_again() {
        for word in [
            "a b",
            "$HOME",
            "it's",
            "q\"uote",
            "back\\slash",
            "~x",
            "a;b|c&d",
            "ñ#(é)",
        ] {
            let quoted = Quotes::None.quote(word).unwrap();
            assert_eq!(unquoted(&quoted), word);
            let quoted = Quotes::Double.quote(word).unwrap();
            assert_eq!(unquoted(&format!("\"{quoted}\"")), word);
            let quoted = Quotes::Single.quote(word).unwrap();
            assert_eq!(unquoted(&format!("'{quoted}'")), word);
        }
        assert_eq!(
            Quotes::None.quote("a\u{1b}\n").unwrap(),
            r"$'a\u001b\u000a'"
        );
        assert_eq!(Quotes::Double.quote("a\u{1b}"), None);
    }

    #[test]
    fn the_value_of_an_option_is_completed_behind_it() {
        for (words, typed, expected) in [
            (&["ril", "--to", "=", "my"][..], "my", "--to=my"),
            (&["ril", "--to", "="], "", "--to="),
        ] {
            let (words, index, _, option) = line(words, typed);
            assert_eq!(words, ["ril", expected]);
            assert_eq!((index, option.as_str()), (1, "--to="));
        }
    }
}
