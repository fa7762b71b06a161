//! The layouts of shared memory are pinned by `layouts/`: a table for people, a header for C and C++, a module with
//! types for Python. All three are made of the same definitions, and a change of one byte fails here.
//!
//! After a deliberate change **raise the layout version** in the struct's type name, and write the files anew with
//! `RIL_WRITE_LAYOUTS=1 cargo test -p ipc-types --test layout`.

use std::fmt::Write;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use ipc_types::code::{
    CameBetween, ControlCommand, DspPathState, Functionality, ImiError, LinkState, MavlinkVehicle,
    ModuleId, ModuleStatus, MovementKind, OutlineKind, ParameterOperation, PilotSwitch, PortKind,
    Reason, RelayLinkState, SafetyAction, SafetyRule, SenderLost, Stage,
};
use ipc_types::configuration::{BridgeConfiguration, StatusConfiguration};
use ipc_types::payload::{
    BridgeJournal, BridgeOutline, Layout, MavlinkStations, Number, RelayLink, RelayStations,
    RequestReport, SharedStruct, StatusJournal,
};
use ipc_types::schema::generate;
use ipc_types::service::{Contract, EVENT_ID_MAX, EventCode, SERVICES};
use ipc_types::{Schema, StateOf, StatusModule, TelemetryGroup};

/// The topics of the gateways, the outline, the configurations and the journals: the robot's own, but without a slot.
const WITHOUT_SLOT: [Contract; 8] = [
    Contract::of_topic::<RelayLink>(),
    Contract::of_topic::<RelayStations>(),
    Contract::of_topic::<MavlinkStations>(),
    Contract::of_topic::<BridgeOutline>(),
    Contract::of_topic::<BridgeConfiguration>(),
    Contract::of_topic::<StatusConfiguration>(),
    Contract::of_topic::<BridgeJournal>(),
    Contract::of_topic::<StatusJournal>(),
];

/// The state of a module, which each module publishes under a key of its own. Only the table for people has it: in C
/// its name would be in everybody's way.
const STATE: Contract = Contract::of_topic::<StateOf<StatusModule>>();

/// The contracts whose names and hashes of layouts consumers in other languages need.
fn contracts() -> impl Iterator<Item = &'static Contract> {
    SERVICES
        .iter()
        .map(|spec| &spec.contract)
        .chain(&WITHOUT_SLOT)
}

/// All structs, each after those that it contains.
fn layouts() -> Vec<&'static Layout> {
    let payloads = SERVICES.iter().map(|spec| spec.contract.payload);
    let others = WITHOUT_SLOT.iter().map(|contract| contract.payload);
    let all: Vec<_> = payloads
        .chain([RequestReport::LAYOUT])
        .chain(others)
        .collect();
    generate::with_nested(&all)
}

/// A set of named numbers: its name, and name and number of each.
type Codes = (&'static str, Vec<(String, u32)>);

fn codes() -> Vec<Codes> {
    macro_rules! of {
        ($code:ident) => {
            (
                stringify!($code),
                $code::ALL
                    .iter()
                    .map(|code| (constant(code.name()), code.code()))
                    .collect(),
            )
        };
    }
    let groups = TelemetryGroup::ALL
        .iter()
        .map(|group| (constant(group.name()), u32::from(group.bit())))
        .collect();
    let events = [
        EventCode::Data,
        EventCode::Arrived,
        EventCode::Left,
        EventCode::Died,
    ];
    let events = events
        .iter()
        .map(|event| (constant(&format!("{event:?}")), *event as u32))
        .collect();
    vec![
        of!(ControlCommand),
        of!(MovementKind),
        of!(ModuleId),
        of!(ModuleStatus),
        of!(Functionality),
        of!(LinkState),
        of!(RelayLinkState),
        of!(MavlinkVehicle),
        of!(DspPathState),
        of!(OutlineKind),
        of!(PilotSwitch),
        of!(SafetyRule),
        of!(SafetyAction),
        of!(ParameterOperation),
        of!(PortKind),
        of!(SenderLost),
        of!(CameBetween),
        of!(Stage),
        of!(Reason),
        of!(ImiError),
        ("TelemetryGroup", groups),
        ("Event", events),
    ]
}

/// `too-far` as the constant `TOO_FAR`.
fn constant(name: &str) -> String {
    name.replace(['-', '/'], "_").to_uppercase()
}

/// Offset, size, type and name of each field.
fn struct_table(layout: &'static Layout) -> String {
    let Layout {
        name,
        type_name,
        size,
        align,
        ..
    } = layout;
    let hash = Schema::from_layout(layout).layout_hash();
    let mut text = format!("{name} {type_name} size {size} align {align} hash {hash:016x}\n");
    for field in layout.fields {
        let mut kind = field.kind.name(Number::rust_name).to_owned();
        if let Some(len) = field.len {
            write!(kind, "[{len}]").unwrap();
        }
        let (offset, size, name) = (field.offset, field.size, field.name);
        writeln!(text, "{offset:6} {size:4} {kind:18} {name}").unwrap();
    }
    text
}

fn table() -> String {
    let mut text = String::from(
        "# Layouts in shared memory: offset, size, type, field. Little-endian, no padding.\n\
         # Made by tests/layout.rs; a difference means another layout: raise the version in the type name.\n",
    );
    for layout in layouts().into_iter().chain([STATE.payload]) {
        text.push('\n');
        text.push_str(&struct_table(layout));
    }
    text.push_str("\n# Services: slot offset, key, pattern, layout, layout hash.\n");
    for spec in &SERVICES {
        let contract = &spec.contract;
        writeln!(
            text,
            "{} {} {:?} {} {:016x}",
            spec.id.slot_offset(),
            contract.key,
            contract.pattern,
            contract.layout(),
            contract.layout_hash()
        )
        .unwrap();
    }
    text.push_str("\n# Topics without a slot: key, pattern, layout, layout hash.\n");
    for contract in WITHOUT_SLOT.iter().chain([&STATE]) {
        writeln!(
            text,
            "{} {:?} {} {:016x}",
            contract.key,
            contract.pattern,
            contract.layout(),
            contract.layout_hash()
        )
        .unwrap();
    }
    text
}

fn c_header() -> String {
    let mut text = String::from(
        "/* Structs and numbers of the HERO RIL in shared memory, for C11 and C++11. docs/ipc.md says what they mean.\n\
         \x20* Made by ipc-types/tests/layout.rs: do not edit. */\n\
         #ifndef HERO_IPC_H\n#define HERO_IPC_H\n\n#include <stddef.h>\n#include <stdint.h>\n\n\
         #ifdef __cplusplus\n#define HERO_ASSERT(what) static_assert(what, #what)\n\
         #else\n#define HERO_ASSERT(what) _Static_assert(what, #what)\n#endif\n\n",
    );
    writeln!(text, "#define HERO_EVENT_ID_MAX {EVENT_ID_MAX}").unwrap();
    for contract in contracts() {
        let key = constant(contract.key);
        writeln!(text, "#define HERO_{key}_LAYOUT \"{}\"", contract.layout()).unwrap();
        writeln!(
            text,
            "#define HERO_{key}_LAYOUT_HASH \"{:016x}\"",
            contract.layout_hash()
        )
        .unwrap();
    }
    for (set, numbers) in codes() {
        writeln!(
            text,
            "\nenum hero_{} {{",
            generate::upper_snake(set).to_lowercase()
        )
        .unwrap();
        for (name, number) in numbers {
            writeln!(
                text,
                "    HERO_{}_{name} = {number},",
                generate::upper_snake(set)
            )
            .unwrap();
        }
        text.push_str("};\n");
    }
    for layout in layouts() {
        text.push('\n');
        text.push_str(&generate::c_struct(layout));
    }
    text.push_str("\n#endif\n");
    text
}

/// What `hero_ipc.py` has above this line is written by hand: what its classes are to a program, and to `mypy`.
const PYTHON_MARK: &str = "\n# What follows is made by ipc-types/tests/layout.rs: do not edit.\n\n";

fn python_head() -> String {
    let module = include_str!("../layouts/hero_ipc.py");
    let (head, _) = module.split_once(PYTHON_MARK).expect("the mark");
    format!("{head}{PYTHON_MARK}")
}

fn python_module() -> String {
    let mut text = python_head();
    text.push_str(
        "#: By service: the values of its attributes `layout` and `layout_hash`.\nLAYOUTS = {\n",
    );
    for contract in contracts() {
        let (key, layout, hash) = (contract.key, contract.layout(), contract.layout_hash());
        writeln!(text, "    \"{key}\": (\"{layout}\", \"{hash:016x}\"),").unwrap();
    }
    text.push_str("}\n");
    for (set, numbers) in codes() {
        let kind = if set == "TelemetryGroup" {
            "IntFlag"
        } else {
            "IntEnum"
        };
        writeln!(text, "\n\nclass {set}(enum.{kind}):").unwrap();
        for (name, number) in numbers {
            // `None` is a keyword; `NONE` is not.
            writeln!(text, "    {name} = {number}").unwrap();
        }
    }
    for layout in layouts() {
        text.push_str(&generate::python_class(layout));
    }
    text
}

fn check(file: &str, made: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("layouts")
        .join(file);
    if std::env::var_os("RIL_WRITE_LAYOUTS").is_some() {
        fs::write(&path, made).unwrap();
    }
    let pinned = fs::read_to_string(&path).unwrap_or_default();
    let difference = made
        .lines()
        .zip(pinned.lines().chain(std::iter::repeat("")))
        .find(|(made, pinned)| made != pinned);
    assert!(
        made == pinned,
        "{file} pins another layout: raise the layout version in the struct's type name, then write the files anew \
         (see the top of tests/layout.rs). First difference, now and pinned: {difference:?}"
    );
}

#[test]
fn the_table_is_pinned() {
    check("layouts.txt", &table());
}

#[test]
fn the_c_header_is_pinned() {
    check("hero_ipc.h", &c_header());
}

#[test]
fn the_python_module_is_pinned() {
    check("hero_ipc.py", &python_module());
}

/// Whether a compiler takes `source`, and what it says; nothing when there is no such compiler.
///
/// That is told past the capture of the tests' output: a check that was not made must be seen.
fn compiles(compiler: &str, options: &[&str], source: &str) -> Option<(bool, String)> {
    let spawned = Command::new(compiler)
        .args(options)
        .args(["-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn();
    let mut child = match spawned {
        Ok(child) => child,
        Err(error) => {
            let _ = writeln!(
                std::io::stderr(),
                "SKIPPED: `{compiler}` cannot be started ({error}), so that it says nothing about hero_ipc.h"
            );
            return None;
        }
    };
    let mut input = child.stdin.take().expect("it is piped");
    input.write_all(source.as_bytes()).unwrap();
    drop(input);
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    Some((output.status.success(), text))
}

/// The header asserts every size and offset; they are those of the Rust compiler. Whether a C compiler that lays the
/// structs out agrees, only that compiler can say, for this machine and for field computers of arm64.
#[test]
fn compilers_of_c_and_cpp_lay_the_structs_out_like_rust() {
    let header = c_header();
    let main = "\nint main(void) { return 0; }\n";
    // Two fields that changed places, as a later version might have them.
    let swapped = header.replace(
        "    double latitude_deg;\n    double longitude_deg;",
        "    double longitude_deg;\n    double latitude_deg;",
    );
    assert_ne!(header, swapped);
    for (compiler, options) in [
        ("cc", ["-x", "c", "-std=c11"]),
        ("c++", ["-x", "c++", "-std=c++11"]),
        ("aarch64-linux-gnu-gcc", ["-x", "c", "-std=c11"]),
    ] {
        if let Some((is_taken, text)) = compiles(compiler, &options, &(header.clone() + main)) {
            assert!(is_taken, "{compiler} has another layout: {text}");
            let other = compiles(compiler, &options, &(swapped.clone() + main));
            let (is_taken, text) = other.expect("it was there a moment ago");
            assert!(
                !is_taken && text.contains("latitude_deg) == 0"),
                "{compiler} takes another layout: {text}"
            );
        }
    }
}

/// The module asserts every size and offset when it is imported.
#[test]
fn python_lays_the_structs_out_like_rust() {
    let module = python_module();
    let run = |source: &str| Command::new("python3").args(["-c", source]).output();
    match run(&module) {
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "another layout: {text}");
            let swapped = module.replacen("(\"latitude_deg\"", "(\"x\"", 1);
            assert!(!run(&swapped).unwrap().status.success());
        }
        Err(error) => {
            let _ = writeln!(
                std::io::stderr(),
                "SKIPPED: `python3` cannot be started ({error}), so that it says nothing about hero_ipc.py"
            );
        }
    }
}

#[test]
fn fields_follow_one_another_without_a_hole() {
    for layout in layouts() {
        let mut end = 0;
        for field in layout.fields {
            assert_eq!(field.offset, end, "{}.{}", layout.name, field.name);
            end += field.size;
        }
        assert_eq!(end, layout.size, "{}", layout.name);
    }
}

#[test]
fn a_type_name_is_the_struct_s_name_with_a_version() {
    for layout in layouts() {
        let version = layout
            .type_name
            .strip_prefix(&format!("hero.{}.v", layout.name));
        assert!(
            version.is_some_and(|version| version.parse::<u32>().is_ok()),
            "{}",
            layout.type_name
        );
    }
}
