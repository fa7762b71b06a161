//! Completion of command lines in bash, zsh and fish, with what lives now: robots, topics, fields, modules, parameters.
//!
//! The shell's script, which [`script`] makes, runs `ril` itself at each press of the key, with [`VARIABLE`] in its
//! environment; [`answer`] prints what can follow. That never takes part in shared memory, so nothing is created there.
//! It says nothing on standard error, and what cannot be found out in time is left out.
//!
//! `Context`: what the words that are on the command line already say about the word that is to be completed.

mod bash;

use std::ffi::OsString;
use std::io;
use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use clap::builder::StyledStr;
use clap::{Arg, ArgMatches, Command, CommandFactory};
use clap_complete::engine::{ArgValueCandidates, CompletionCandidate};
use clap_complete::env::{CompleteEnv, EnvCompleter, Fish, Shells, Zsh};
use dsp_protocol::port::{PORTS_16, PORTS_32};
use ipc_types::{Domain, RobotId};
use operator::render::fields::field_names;
use operator::robot::domain::Looking;
use operator::session::alive;
use operator::topic_name::{SHORT_NAMES, key_of};
use runtime::environment::without_empty_variables;

use self::bash::{INDEX_VARIABLE, QuotingBash};
use crate::cli::{Cli, CompletionShell};

/// The environment variable that asks for an answer, and names the shell. Not `COMPLETE`, the usual one: a variable of
/// this name that a user has set for something else would turn `ril land` into a completion.
pub const VARIABLE: &str = "RIL_COMPLETE";

/// How the scripts call this program: the one that the shell finds.
const PROGRAM: &str = "ril";

/// Completes an autoloaded function of zsh at its first call too, which otherwise only defines it.
const ZSH_AUTOLOAD: &str =
    "if [[ \"$funcstack[1]\" == _ril ]]; then _clap_dynamic_completer_ril \"$@\"; fi\n";

/// The script that makes `shell` complete the command lines of `ril`.
///
/// # Errors
///
/// Never in practice: it is written into memory.
pub fn script(shell: CompletionShell) -> io::Result<String> {
    let mut text = Vec::new();
    completer(shell).write_registration(VARIABLE, PROGRAM, PROGRAM, PROGRAM, &mut text)?;
    let mut text = String::from_utf8_lossy(&text).trim_start().to_owned();
    if shell == CompletionShell::Zsh {
        text.push_str(ZSH_AUTOLOAD);
    }
    Ok(text)
}

fn completer(shell: CompletionShell) -> &'static dyn EnvCompleter {
    match shell {
        CompletionShell::Bash => &QuotingBash,
        CompletionShell::Zsh => &Zsh,
        CompletionShell::Fish => &Fish,
    }
}

/// Whether a shell asks what can follow on its command line.
pub fn is_asked() -> bool {
    std::env::var_os(VARIABLE).is_some()
}

/// Answers a shell; `args` are those of the process. Whatever goes wrong, nothing is printed.
pub fn answer(args: impl IntoIterator<Item = OsString>) {
    // A message in the middle of a person's command line would only disturb.
    std::panic::set_hook(Box::new(|_| {}));
    let args: Vec<OsString> = args.into_iter().collect();
    let context = Arc::new(Context::of(before_cursor(&args)));
    let shells: [&dyn EnvCompleter; 3] = [&QuotingBash, &Zsh, &Fish];
    let _ = CompleteEnv::with_factory(|| with_live_values(Cli::command(), &context))
        .var(VARIABLE)
        .shells(Shells(&shells))
        .bin(PROGRAM)
        .completer(PROGRAM)
        .try_complete(args, std::env::current_dir().ok().as_deref());
}

/// The words of the command line before the one that is to be completed.
fn before_cursor(args: &[OsString]) -> &[OsString] {
    let begin = args.iter().position(|arg| arg == "--");
    let words = begin.map_or(&[][..], |begin| &args[begin + 1..]);
    let index = std::env::var(INDEX_VARIABLE).ok();
    let index = index.and_then(|index| index.parse::<usize>().ok());
    let end = index.unwrap_or_else(|| words.len().saturating_sub(1));
    &words[..end.min(words.len())]
}

/// Adds the look-ups to the options and arguments that they are for, in all verbs.
fn with_live_values(command: Command, context: &Arc<Context>) -> Command {
    let verb = command.get_name().to_owned();
    command
        .mut_args(|arg| match look_up(&verb, &arg) {
            Some(look_up) => {
                let context = Arc::clone(context);
                arg.add(ArgValueCandidates::new(move || {
                    candidates(look_up, &context)
                }))
            }
            None => arg,
        })
        .mut_subcommands(|inner| with_live_values(inner, context))
}

/// What is looked up for a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LookUp {
    Robots,
    Topics,
    Fields,
    Modules,
    Parameters,
}

/// What is looked up for an argument of a verb; `None` where the definition of the command line says all.
fn look_up(verb: &str, arg: &Arg) -> Option<LookUp> {
    match arg.get_id().as_str() {
        "robot" => Some(LookUp::Robots),
        "topic" => Some(LookUp::Topics),
        "fields" => Some(LookUp::Fields),
        "module" => Some(LookUp::Modules),
        // Elsewhere that is the serial port, a path.
        "port" if ["get", "set"].contains(&verb) => Some(LookUp::Parameters),
        _ => None,
    }
}

fn candidates(look_up: LookUp, context: &Arc<Context>) -> Vec<CompletionCandidate> {
    let context = Arc::clone(context);
    let offers = match look_up {
        LookUp::Robots => within_limit(robots),
        LookUp::Topics => match within_limit(move || topics(&context)) {
            found if found.is_empty() => own_topics(),
            found => found,
        },
        LookUp::Fields => within_limit(move || fields(&context)),
        LookUp::Modules => within_limit(move || modules(&context)),
        LookUp::Parameters => parameters(),
    };
    offers.into_iter().map(candidate).collect()
}

fn candidate(offer: Offer) -> CompletionCandidate {
    let help = (!offer.help.is_empty()).then(|| StyledStr::from(offer.help));
    CompletionCandidate::new(offer.value).help(help)
}

/// What is said already.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Context {
    /// The robot that is named, on the command line or in the environment; else robot 1.
    pub robot: RobotId,
    /// Key of the topic that is named.
    pub topic: Option<String>,
}

impl Context {
    /// Reads the words before the one that is to be completed, of which the first is the program's name. What cannot be
    /// understood is skipped.
    pub fn of(words: &[OsString]) -> Context {
        let mut context = Context {
            robot: RobotId::DEFAULT,
            topic: None,
        };
        let read = without_empty_variables(Cli::command())
            .ignore_errors(true)
            .try_get_matches_from(words);
        let Ok(matches) = read else {
            return context;
        };
        let mut level = Some(&matches);
        while let Some(matches) = level {
            if let Ok(Some(robot)) = matches.try_get_one::<NonZeroU32>("robot") {
                context.robot = RobotId::from(*robot);
            }
            if let Some(topic) = first_text(matches, "topic") {
                context.topic = Some(key_of(&topic).to_owned());
            }
            level = matches.subcommand().map(|(_, inner)| inner);
        }
        context
    }
}

/// The value of an option as it stands there; `None` if the command has no such option.
fn first_text(matches: &ArgMatches, id: &str) -> Option<String> {
    let mut values = matches.try_get_raw(id).ok()??;
    Some(values.next()?.to_str()?.to_owned())
}

/// How long a look-up may take. A person notices a delay of about 200 ms after the key; this leaves 50 ms to start the
/// program. A look-up takes about a millisecond. One that takes longer is abandoned, and nothing is offered.
const LOOK_UP_LIMIT: Duration = Duration::from_millis(150);

/// How the keys of services end that start and stop a module.
const CONTROL: &str = "/control";

/// A value that can be offered, and what it is.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Offer {
    pub value: String,
    pub help: String,
}

impl Offer {
    fn new(value: impl Into<String>, help: impl Into<String>) -> Offer {
        Offer {
            value: value.into(),
            help: help.into(),
        }
    }
}

/// What `look` finds within [`LOOK_UP_LIMIT`]. When it takes longer, or fails in any way, that is nothing.
fn within_limit(look: impl FnOnce() -> Vec<Offer> + Send + 'static) -> Vec<Offer> {
    Looking::start(look).end(LOOK_UP_LIMIT).unwrap_or_default()
}

/// The robots of this user of which a bridge, a status or a relay lives.
fn robots() -> Vec<Offer> {
    let Ok(domain) = Domain::from_environment() else {
        return Vec::new();
    };
    let living = alive(&domain).unwrap_or_default();
    let offer = |robot: RobotId| Offer::new(robot.to_string(), "robot that is alive");
    living.into_iter().map(offer).collect()
}

/// The short names of the robot's own topics, and the topics of its modules.
fn topics(context: &Context) -> Vec<Offer> {
    let mut offers = own_topics();
    if let Ok(domain) = Domain::from_environment() {
        let live = domain.topics(context.robot).into_iter();
        let live = live.filter(|topic| topic.provider.is_some());
        offers.extend(live.map(|topic| Offer::new(topic.key, topic.schema.type_name())));
    }
    offers
}

/// The short names of the robot's own topics.
fn own_topics() -> Vec<Offer> {
    let offer = |(name, _, help)| Offer::new(name, help);
    SHORT_NAMES.map(offer).into()
}

/// The fields of the topic that is named.
fn fields(context: &Context) -> Vec<Offer> {
    let (Ok(domain), Some(topic)) = (Domain::from_environment(), &context.topic) else {
        return Vec::new();
    };
    let Ok(schema) = domain.schema_of(context.robot, topic) else {
        return Vec::new();
    };
    let names = field_names(schema.root()).into_iter();
    names.map(|name| Offer::new(name, "")).collect()
}

/// The modules of the robot that can be started and stopped.
fn modules(context: &Context) -> Vec<Offer> {
    let Ok(domain) = Domain::from_environment() else {
        return Vec::new();
    };
    let services = domain.request_services(context.robot).into_iter();
    services
        .filter(|service| service.provider.is_some())
        .filter_map(|service| {
            let name = service.key.strip_suffix(CONTROL)?;
            Some(Offer::new(name, "module that is alive"))
        })
        .collect()
}

/// The DSP's parameters: the bridge lists the same table.
fn parameters() -> Vec<Offer> {
    let short = PORTS_16.iter().map(|port| {
        let help = format!("{} to {}, at boot {}", port.min, port.max, port.boot);
        Offer::new(port.name, help)
    });
    let long = PORTS_32.iter().map(|port| {
        let help = format!("{} to {}, at boot {}", port.min, port.max, port.boot);
        Offer::new(port.name, help)
    });
    short.chain(long).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look_ups(command: &Command, found: &mut Vec<(String, LookUp)>) {
        for arg in command.get_arguments() {
            if let Some(one) = look_up(command.get_name(), arg) {
                found.push((command.get_name().to_owned(), one));
            }
        }
        command
            .get_subcommands()
            .for_each(|inner| look_ups(inner, found));
    }

    #[test]
    fn each_look_up_belongs_to_verbs_that_there_are() {
        let mut found = Vec::new();
        look_ups(&Cli::command(), &mut found);
        for expected in [
            ("info", LookUp::Topics),
            ("echo", LookUp::Fields),
            ("start", LookUp::Modules),
            ("get", LookUp::Parameters),
            ("set", LookUp::Parameters),
        ] {
            let expected = (expected.0.to_owned(), expected.1);
            assert!(found.contains(&expected), "{expected:?}: {found:?}");
        }
        assert!(found.iter().any(|(_, one)| *one == LookUp::Robots));
        assert!(!found.contains(&("bridge".to_owned(), LookUp::Parameters)));
    }

    #[test]
    fn the_words_before_the_cursor_are_those_after_the_dashes() {
        let args =
            |line: &str| -> Vec<OsString> { line.split_whitespace().map(OsString::from).collect() };
        for (line, expected) in [
            ("ril -- ril state --ro", "ril state"),
            ("ril --", ""),
            ("ril", ""),
        ] {
            assert_eq!(before_cursor(&args(line)), args(expected), "{line}");
        }
    }

    #[test]
    fn a_script_asks_this_program_and_has_no_path_of_this_machine() {
        for shell in [
            CompletionShell::Bash,
            CompletionShell::Zsh,
            CompletionShell::Fish,
        ] {
            let script = script(shell).unwrap();
            assert!(script.contains(VARIABLE), "{script}");
            assert!(
                !script.contains('\u{b}') && !script.contains("/target/"),
                "{script}"
            );
        }
        assert!(
            script(CompletionShell::Zsh)
                .unwrap()
                .starts_with("#compdef ril\n")
        );
    }
}

#[cfg(test)]
mod context_tests {
    use super::*;

    fn context(line: &str) -> (u32, Option<String>) {
        let words: Vec<OsString> = line.split_whitespace().map(OsString::from).collect();
        let context = Context::of(&words);
        (context.robot.get(), context.topic)
    }

    #[test]
    fn robot_and_topic_are_found_wherever_they_stand() {
        let hero = || Some("hero_telemetry".to_owned());
        for (line, expected) in [
            ("ril", (1, None)),
            ("ril state --robot 7", (7, None)),
            ("ril state --robot=7 --json", (7, None)),
            ("ril echo hero --robot 3 --field", (3, hero())),
            ("ril echo --json hero --field", (1, hero())),
            ("ril topic echo hero --field", (1, hero())),
            (
                "ril topic echo watch/cells --field level --field",
                (1, Some("watch/cells".to_owned())),
            ),
        ] {
            assert_eq!(context(line), expected, "{line}");
        }
    }

    #[test]
    fn what_cannot_be_understood_is_skipped() {
        for line in [
            "",
            "ril nonsense",
            "ril state --robot",
            "ril state --robot x",
            "ril --help",
        ] {
            assert_eq!(context(line), (1, None), "{line}");
        }
    }
}

#[cfg(test)]
mod live_tests {
    use super::*;

    #[test]
    fn a_look_up_that_hangs_or_fails_offers_nothing() {
        let (_never, hangs) = std::sync::mpsc::channel::<()>();
        let hang = move || {
            let _ = hangs.recv();
            vec![Offer::new("late", "")]
        };
        assert_eq!(within_limit(hang), []);
        assert_eq!(within_limit(|| panic!("meant to be")), []);
        assert_eq!(within_limit(own_topics), own_topics());
    }

    #[test]
    fn fields_of_the_robots_own_topics_are_known_without_a_robot() {
        let context = Context {
            robot: RobotId::new(u32::MAX).unwrap(),
            topic: Some("hero_telemetry".to_owned()),
        };
        let fields = fields(&context);
        let is_there = |name: &str| fields.iter().any(|field| field.value == name);
        assert!(
            is_there("geodetic.altitude_m") && is_there("velocity"),
            "{fields:?}"
        );
    }

    #[test]
    fn parameters_have_the_names_of_the_bridge() {
        let parameters = parameters();
        assert!(parameters.iter().any(|one| one.value == "cruise_speed_mps"));
        assert!(parameters.iter().any(|one| one.value == "trim_tail_us"));
    }
}
