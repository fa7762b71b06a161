//! Completion in real shells, with the scripts that `ril completions` prints.

use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::process::Command;

use ipc_types::{ControlOf, RobotId};
use ril_tests::process::Finished;
use ril_tests::{Process, Sandbox, StandInBridge, StandInServer, StandInTopic};
use rustix::fs::{CWD, Mode, mkfifoat};

use super::has;
use crate::common::{end_all, sandbox};

ipc_types::shared_struct! {
    /// Voltages of a battery's cells.
    pub struct Voltages("battery_watch.Voltages.v1") = 32 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publisher began, host monotonic ns.
        pub epoch_ns: u64,
        /// The lowest of all cells, V.
        pub lowest_v: f64,
        /// The highest of all cells, V.
        pub highest_v: f64,
    }
}
ipc_types::topic!(Voltages, "battery_watch/voltages");

struct BatteryWatch;
ipc_types::module!(BatteryWatch, "battery_watch", 1001);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shell {
    Bash,
    Zsh,
    Fish,
}

impl Shell {
    const ALL: [Shell; 3] = [Shell::Bash, Shell::Zsh, Shell::Fish];

    fn name(self) -> &'static str {
        match self {
            Shell::Bash => "bash",
            Shell::Zsh => "zsh",
            Shell::Fish => "fish",
        }
    }

    /// Prints the candidates for the last of the words `$@`, one a line, with the script in `$SCRIPT`.
    fn program(self) -> &'static str {
        match self {
            Shell::Bash => {
                "source \"$SCRIPT\"; [[ $(complete -p ril) == *_clap_complete_ril* ]] || exit 9
                COMP_WORDS=(\"$@\"); COMP_CWORD=$(($# - 1)); COMP_TYPE=9
                _clap_complete_ril ril \"${COMP_WORDS[-1]}\" \"${COMP_WORDS[-2]}\"
                printf '%s\\n' \"${COMPREPLY[@]}\""
            }
            // A shell that is not interactive has no completion system: its two functions are stood in for.
            Shell::Zsh => {
                "compdef() { [[ $2 == ril ]] || exit 9 }
                _describe() { print -rl -- \"${(@P)3}\" }
                source \"$SCRIPT\"; words=(\"$@\"); CURRENT=$#
                _clap_dynamic_completer_ril"
            }
            Shell::Fish => "source $SCRIPT; complete --do-complete \"$argv\"",
        }
    }
}

/// Shells of this machine, each with its script and `ril` where it looks for programs.
struct Shells<'a> {
    rig: &'a Sandbox,
}

impl Shells<'_> {
    fn new(rig: &Sandbox) -> Shells<'_> {
        symlink(env!("CARGO_BIN_EXE_ril"), rig.folder().join("ril")).unwrap();
        for shell in Shell::ALL {
            let script = rig.run(&format!("completions {}", shell.name()), 0).stdout;
            rig.write(shell.name(), &(script.join("\n") + "\n"));
        }
        Shells { rig }
    }

    /// `command` as a shell of the rig.
    fn place(&self, mut command: Command, shell: Shell) -> Process {
        let path = std::env::var("PATH").unwrap();
        let folder = self.rig.folder();
        command
            .current_dir(folder)
            .env("PATH", format!("{}:{path}", folder.display()))
            .env("SCRIPT", folder.join(shell.name()))
            .env("HOME", folder)
            .env_remove("RIL_ROBOT");
        Process::spawn(&self.rig.domain, command)
    }

    /// The candidates for the last of `words`, without their descriptions.
    #[track_caller]
    fn complete(&self, shell: Shell, words: &[&str]) -> Vec<String> {
        let mut command = Command::new(shell.name());
        if shell == Shell::Zsh {
            command.arg("-f");
        }
        command.args(["-c", shell.program()]);
        match shell {
            // The first word after the program is `$0`.
            Shell::Bash | Shell::Zsh => command.arg("shell").args(words),
            Shell::Fish => command.args(words),
        };
        let finished = self.place(command, shell).wait_exit();
        let said = format!("{shell:?} {words:?}: {finished:#?}");
        assert_eq!(finished.code(), Some(0), "{said}");
        assert!(finished.stderr.is_empty(), "{said}");
        let value = |line: String| {
            let end = line.find(['\t', ':']).unwrap_or(line.len());
            line[..end].trim_end().to_owned()
        };
        let lines = finished.stdout.into_iter().map(value);
        lines.filter(|line| !line.is_empty()).collect()
    }

    /// Completes in every shell of this machine, and says whether a look-up came in time: a machine that stalls offers
    /// less.
    #[track_caller]
    fn each(&self, words: &[&str], mut check: impl FnMut(&[String]) -> bool) {
        for shell in Shell::ALL {
            if !has(shell.name(), "its completion is not tested") {
                continue;
            }
            // A look-up that took too long offers nothing; then the person presses the key again, and so does this.
            let is_right = (0..ATTEMPTS).any(|_| check(&self.complete(shell, words)));
            assert!(
                is_right,
                "{shell:?} {words:?}: {:?}",
                self.complete(shell, words)
            );
        }
    }
}

/// How often the key is pressed at most on a machine that stalls.
const ATTEMPTS: u32 = 20;

#[test]
fn robots_topics_fields_modules_and_parameters_are_those_that_live() {
    let rig = sandbox();
    let shells = Shells::new(&rig);
    let sim = rig.sim(2, "");
    let bridge = rig.bridge(2);
    rig.watch(2).until_ready();
    let robot = RobotId::new(2).unwrap();
    let _voltages = StandInTopic::<Voltages>::start_for(&rig.domain, robot);
    let _control = StandInServer::<ControlOf<BatteryWatch>>::start_for(&rig.domain, robot);

    shells.each(&["ril", "land", "--robot", ""], |found| found == ["2"]);
    let info = ["ril", "topic", "info", "--robot", "2", ""];
    shells.each(&info, |found| {
        let is_there = |key: &str| found.iter().any(|one| one == key);
        is_there("hero") && is_there("dsp_telemetry") && is_there("battery_watch/voltages")
    });
    let echo = "ril --robot 2 topic echo battery_watch/voltages --field";
    let echo = echo.strip_prefix("ril --robot 2 ").unwrap();
    let mut words = vec!["ril"];
    words.extend(echo.split(' '));
    words.splice(3..3, ["--robot", "2"]);
    words.push("l");
    shells.each(&words, |found| found == ["lowest_v"]);
    shells.each(
        &["ril", "echo", "hero", "--field", "geodetic.al"],
        |found| found == ["geodetic.altitude_m"],
    );
    shells.each(&["ril", "stop", "--robot", "2", "--module", ""], |found| {
        found == ["battery_watch"]
    });
    shells.each(&["ril", "param", "set", "cruise"], |found| {
        found == ["cruise_speed_mps"]
    });
    end_all([bridge, sim]);
}

#[test]
fn verbs_and_options_are_completed_without_a_robot_and_nothing_is_created() {
    let rig = sandbox();
    let shells = Shells::new(&rig);
    shells.each(&["ril", "take"], |found| found == ["takeoff"]);
    shells.each(&["ril", "st"], |found| {
        let mut found = found.to_vec();
        found.sort();
        found == ["start", "status", "stop"]
    });
    shells.each(&["ril", "goto", "--pre"], |found| found == ["--preempt"]);
    shells.each(&["ril", "completions", ""], |found| {
        found.iter().any(|one| one == "fish")
    });
    for words in [
        &["ril", "land", "--robot", ""][..],
        &["ril", "stop", "--module", ""],
        &["ril", "topic", "echo", "watch/none", "--field", ""],
    ] {
        shells.each(words, <[String]>::is_empty);
    }
    assert!(
        rig.domain.residue().is_empty(),
        "{:?}",
        rig.domain.residue()
    );
}

#[test]
fn in_bash_a_name_of_any_letters_stays_one_word() {
    let rig = sandbox();
    let shells = Shells::new(&rig);
    for (name, typed) in [
        ("two words.plan", "two"),
        ("two words.plan", "two\\ w"),
        ("$HOME.plan", "\\$"),
        ("it's.plan", "it"),
        ("say \"it\".plan", "say"),
        ("back\\slash.plan", "back"),
        ("st*r[1].plan", "st"),
        ("a;b|c&(d)<e>.plan", "a"),
        ("tab\there\n.plan", "tab"),
    ] {
        rig.write(name, "");
        let program = format!(
            "{}; eval \"printf '%s\\0' ${{COMPREPLY[0]}}\"",
            Shell::Bash.program()
        );
        let mut command = Command::new("bash");
        command.args(["-c", &program, "shell", "ril", "plan", "check", typed]);
        let said = shells
            .place(command, Shell::Bash)
            .exits(0)
            .stdout
            .join("\n");
        let (_, words) = said.split_once('\n').unwrap_or_default();
        assert!(said.ends_with(&format!("{name}\0")), "{name}: {said:?}");
        assert_eq!(words.matches('\0').count(), 1, "{name}: {said:?}");
    }
    // A name that would be taken for an option.
    rig.write("-x.plan", "");
    let offered = shells.complete(Shell::Bash, &["ril", "plan", "check", ""]);
    assert!(offered.contains(&"./-x.plan".to_owned()), "{offered:?}");
}

#[test]
fn zsh_finds_the_script_in_a_folder_of_functions() {
    if !has("zsh", "autoloading of its script is not tested") {
        return;
    }
    let rig = sandbox();
    let shells = Shells::new(&rig);
    fs::copy(rig.folder().join("zsh"), rig.folder().join("_ril")).unwrap();
    let mut command = Command::new("zsh");
    let program = "fpath=($PWD $fpath); autoload -Uz compinit; compinit -u -D; print $_comps[ril]";
    command.args(["-f", "-c", program]);
    let finished = shells.place(command, Shell::Zsh).wait_exit();
    assert_eq!(finished.stdout, ["_ril"], "{finished:#?}");
}

/// Runs `ril` as the script of `shell` does.
fn ask(rig: &Sandbox, shell: &str, index: &str, words: &[&std::ffi::OsStr]) -> Finished {
    let mut command = rig.command(["--"]);
    command
        .args(words)
        .env("RIL_COMPLETE", shell)
        .env("_CLAP_COMPLETE_INDEX", index);
    Process::spawn(&rig.domain, command).wait_exit()
}

#[test]
fn whatever_is_wrong_a_completion_says_nothing() {
    let rig = sandbox();
    let garbage = std::ffi::OsStr::from_bytes(b"\xff\xfe-");
    let word = |text: &'static str| std::ffi::OsStr::new(text);
    let robot = [word("ril"), word("land"), word("--robot"), word("")];
    for (shell, index, words) in [
        ("nosuch", "3", &robot[..]),
        ("bash", "none", &robot),
        ("bash", "999", &robot),
        ("zsh", "-1", &robot),
        ("bash", "2", &[word("ril"), garbage, garbage]),
        ("fish", "0", &[word("--"), word("--"), garbage]),
    ] {
        let finished = ask(&rig, shell, index, words);
        assert_eq!(
            finished.code(),
            Some(0),
            "{shell} {index} {words:?}: {finished:#?}"
        );
        assert!(
            finished.stderr.is_empty(),
            "{shell} {index} {words:?}: {finished:#?}"
        );
    }
    // A root that cannot be used, and pipes in the place of what would be read.
    let pipes = rig.folder().join("root/1/movement");
    fs::create_dir_all(&pipes).unwrap();
    for name in ["lock", "current"] {
        mkfifoat(CWD, pipes.join(name), Mode::RUSR | Mode::WUSR).unwrap();
    }
    for root in ["relative", "/", rig.folder().join("root").to_str().unwrap()] {
        let mut command = rig.command(["--", "ril", "topic", "info", ""]);
        command.env("RIL_COMPLETE", "fish");
        // The process is put into the rig's domain; this names another one.
        let mut shell = Command::new("env");
        shell.arg(format!("RIL_IPC_ROOT={root}"));
        shell.arg(command.get_program()).args(command.get_args());
        shell.env("RIL_COMPLETE", "fish").current_dir(rig.folder());
        let finished = Process::spawn(&rig.domain, shell).exits(0);
        assert!(finished.stderr.is_empty(), "{root}: {finished:#?}");
        assert!(
            finished.stdout.iter().any(|line| line.starts_with("hero")),
            "{root}: {finished:#?}"
        );
    }
}

#[test]
fn the_usual_variable_of_other_programs_turns_no_command_into_a_completion() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let mut command = rig.command(["land"]);
    command.env("COMPLETE", "bash");
    Process::spawn(&rig.domain, command).exits(0);
    bridge.next_request();
}
